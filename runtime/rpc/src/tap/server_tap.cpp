#include "tap/server_tap.hpp"

#include <algorithm>
#include <bit>
#include <mutex>
#include <utility>

#include "rtpm/rt/clock.hpp"

namespace rtpm::rpc {
namespace {

constexpr std::uint32_t kRingByteMin = 4 * 1024;
constexpr std::uint32_t kRingByteMax = 256 * 1024 * 1024;
// The largest record, with the padding before it, fits an empty ring.
constexpr std::uint32_t kPayloadShare = 8;
// A lane writes for microseconds, unless it has been preempted.
constexpr Duration kOffPatience = std::chrono::seconds{1};
constexpr Duration kOffInterval = std::chrono::microseconds{200};

expected<void, SetupError> check(const TapConfig& config) {
  if (!std::has_single_bit(config.ring_byte_count) || config.ring_byte_count < kRingByteMin ||
      config.ring_byte_count > kRingByteMax) {
    return setup_error("a tap's ring of " + std::to_string(config.ring_byte_count) + " bytes", "",
                       "choose a power of two from 4 KiB to 256 MiB");
  }
  if (config.payload_byte_max > config.ring_byte_count / kPayloadShare) {
    return setup_error(
        "a tap of payloads of up to " + std::to_string(config.payload_byte_max) + " bytes", "",
        "choose at most an eighth of the ring's " + std::to_string(config.ring_byte_count));
  }
  return {};
}

ConstBytes taken_from(const std::byte*& at, bool is_there, std::uint32_t size) noexcept {
  if (!is_there) return {};
  const ConstBytes payload(at, size);
  at += (size + TapRing::kUnit - 1) / TapRing::kUnit * TapRing::kUnit;
  return payload;
}

TappedCall call_of(const TapRecord& record) noexcept {
  TappedCall call{.stage = static_cast<TapStage>(record.stage),
                  .status = static_cast<wire::Status>(record.status),
                  .number = record.number,
                  .service = record.service,
                  .method = record.method,
                  .priority = Priority{record.priority},
                  .session = record.session,
                  .trace_id = record.trace_id,
                  .received = time_from_ns(record.received_ns),
                  .finished = time_from_ns(record.finished_ns),
                  .request_size = record.request_size,
                  .reply_size = record.reply_size};
  const auto* at = reinterpret_cast<const std::byte*>(&record + 1);
  call.request = taken_from(at, record.has_request, record.request_size);
  call.reply = taken_from(at, record.has_reply, record.reply_size);
  return call;
}

}  // namespace

expected<void, SetupError> ServerTap::make_filter(const TapConfig& config) {
  paths_ = objects_->paths();
  filter_ = {.has_payloads = config.has_payloads,
             .payload_byte_max = config.has_payloads ? config.payload_byte_max : 0};
  using Interest = TapFilter::Interest;
  filter_.interests.assign(paths_.size(),
                           config.objects.empty() ? Interest::kAll : Interest::kNone);
  filter_.methods.resize(paths_.size());
  for (const TappedObject& wanted : config.objects) {
    const auto found = std::ranges::find(paths_, wanted.path);
    if (found == paths_.end()) {
      return setup_error("the server has no object '" + wanted.path + "' to tap");
    }
    const auto index = static_cast<std::size_t>(found - paths_.begin());
    filter_.interests[index] = wanted.methods.empty() ? Interest::kAll : Interest::kSome;
    filter_.methods[index] = wanted.methods;
  }
  const auto excluded = std::ranges::find(paths_, config.excluded_path);
  if (excluded != paths_.end()) {
    filter_.interests[static_cast<std::size_t>(excluded - paths_.begin())] = Interest::kNone;
  }
  return {};
}

expected<void, SetupError> ServerTap::switch_on(const TapConfig& config) {
  const std::lock_guard lock(mutex_);
  if (objects_ == nullptr) return setup_error("the server has stopped, so that nothing is tapped");
  if (is_on())
    return setup_error("the server's calls are tapped already", "", "end that tap first");
  if (!wait_for_lanes()) {
    return setup_error("a lane still writes for the last tap", "", "try again");
  }
  if (auto checked = check(config); !checked) return checked;
  if (auto made = make_filter(config); !made) return made;
  ++generation_;
  tracks_.clear();
  std::uint64_t step = 0;
  for (const LaneTap* const lane : lanes_)
    step += lane->writer_count();
  for (std::uint64_t number = next_number_; number < next_number_ + step; ++number)
    tracks_.emplace_back(filter_, generation_, number, step, config.ring_byte_count);
  turn_ = 0;
  busy_count_ = 0;
  is_on_.store(true, std::memory_order_relaxed);
  auto track = tracks_.begin();
  for (LaneTap* const lane : lanes_) {
    static_cast<void>(lane->take_busy_count());
    for (std::uint32_t writer = 0; writer < lane->writer_count(); ++writer)
      lane->connect(writer, *track++);
  }
  return {};
}

void ServerTap::disconnect() noexcept {
  for (LaneTap* const lane : lanes_)
    lane->disconnect();
  is_on_.store(false, std::memory_order_relaxed);
}

// SYNC POINT tap-off: switches the tap off, then checks the lanes' writers.
bool ServerTap::wait_for_lanes() const noexcept {
  const auto is_in_use = [this] {
    return std::ranges::any_of(lanes_, [](const LaneTap* lane) { return lane->is_in_use(); });
  };
  const MonotonicTime end = rt::now() + kOffPatience;
  while (is_in_use()) {
    if (rt::now() >= end) return false;
    rt::sleep_until(rt::now() + kOffInterval);
  }
  return true;
}

void ServerTap::switch_off() noexcept {
  const std::lock_guard lock(mutex_);
  held_ = nullptr;
  disconnect();
  // If lanes still use the rings, the next switch_on() frees them.
  if (!wait_for_lanes()) return;
  for (const TapTrack& track : tracks_)
    next_number_ = std::max(next_number_, track.next_number);
  tracks_.clear();
}

void ServerTap::close() noexcept {
  const std::lock_guard lock(mutex_);
  disconnect();
  lanes_.clear();
  objects_ = nullptr;
}

std::optional<TappedCall> ServerTap::next() noexcept {
  if (held_ != nullptr) held_->pop(*held_record_);
  held_ = nullptr;
  const std::size_t count = tracks_.size();
  for (std::size_t i = 0; i < count; ++i) {
    // Reads the tracks in turn, so that the others' rings do not fill up during a busy one.
    if (++turn_ >= count) turn_ = 0;
    TapRing& ring = tracks_[turn_].ring;
    held_record_ = ring.front();
    if (held_record_ == nullptr) continue;
    held_ = &ring;
    return call_of(*held_record_);
  }
  return std::nullopt;
}

TapLosses ServerTap::losses() noexcept {
  {
    const std::lock_guard lock(mutex_);
    for (LaneTap* const lane : lanes_)
      busy_count_ += lane->take_busy_count();
  }
  TapLosses losses{.dropped_count = busy_count_};
  for (const TapTrack& track : tracks_) {
    losses.dropped_count += track.dropped_count.load(std::memory_order_relaxed);
    losses.omitted_payload_count += track.omitted_payload_count.load(std::memory_order_relaxed);
  }
  return losses;
}

}  // namespace rtpm::rpc
