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
// The largest record and the padding before it fit an empty ring.
constexpr std::uint32_t kPayloadShare = 8;
// A lane writes for microseconds, unless the system has taken its CPU away.
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
  const TapWord word = TapWord::of(record.word);
  TappedCall call{.stage = static_cast<TapStage>(word.stage),
                  .status = static_cast<wire::Status>(word.status),
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
  call.request = taken_from(at, word.has_request, record.request_size);
  call.reply = taken_from(at, word.has_reply, record.reply_size);
  return call;
}

}  // namespace

expected<void, SetupError> ServerTap::make_filter(const TapConfig& config) {
  paths_ = objects_->paths();
  filter_ = {.has_payloads = config.has_payloads, .payload_byte_max = config.payload_byte_max};
  filter_.wishes.resize(paths_.size());
  for (TapFilter::Wish& wish : filter_.wishes)
    wish.is_wanted = config.objects.empty();
  for (const TappedObject& wanted : config.objects) {
    const auto found = std::ranges::find(paths_, wanted.path);
    if (found == paths_.end()) {
      return setup_error("the server has no object '" + wanted.path + "' to tap");
    }
    TapFilter::Wish& wish = filter_.wishes[static_cast<std::size_t>(found - paths_.begin())];
    wish = {.is_wanted = true, .methods = wanted.methods};
  }
  const auto excluded = std::ranges::find(paths_, config.excluded_path);
  if (excluded != paths_.end()) {
    filter_.wishes[static_cast<std::size_t>(excluded - paths_.begin())].is_wanted = false;
  }
  return {};
}

expected<void, SetupError> ServerTap::switch_on(const TapConfig& config) {
  const std::lock_guard lock(mutex_);
  if (objects_ == nullptr) return setup_error("the server has stopped, so that nothing is tapped");
  if (is_on()) return setup_error("the server's calls are tapped already", "", "end that tap first");
  if (!wait_for_lanes()) {
    return setup_error("a lane still writes for the last tap", "", "try again");
  }
  if (auto checked = check(config); !checked) return checked;
  if (auto made = make_filter(config); !made) return made;
  ++generation_;
  next_numbers_.resize(lanes_.size());
  tapes_.clear();
  const auto lane_count = static_cast<std::uint32_t>(lanes_.size());
  for (std::uint32_t lane = 0; lane < lane_count; ++lane) {
    tapes_.emplace_back(filter_, config.ring_byte_count, next_numbers_[lane], generation_, lane,
                        lane_count);
  }
  turn_ = 0;
  is_on_.store(true, std::memory_order_relaxed);
  for (std::uint32_t lane = 0; lane < lane_count; ++lane)
    lanes_[lane]->connect(tapes_[lane]);
  return {};
}

void ServerTap::disconnect() noexcept {
  for (LaneTap* const lane : lanes_)
    lane->disconnect();
  is_on_.store(false, std::memory_order_relaxed);
}

// SYNC POINT tap-off: the tap is off, then the lanes' writers are looked for.
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
  // Else the next switch_on() frees them, once the lanes are done.
  if (!wait_for_lanes()) return;
  for (std::size_t lane = 0; lane < std::min(tapes_.size(), next_numbers_.size()); ++lane)
    next_numbers_[lane] = tapes_[lane].ring.next_number();
  tapes_.clear();
}

void ServerTap::close() noexcept {
  const std::lock_guard lock(mutex_);
  disconnect();
  lanes_.clear();
  objects_ = nullptr;
}

std::optional<TappedCall> ServerTap::next() noexcept {
  if (held_ != nullptr) held_->pop();
  held_ = nullptr;
  for (std::size_t i = 0; i < tapes_.size(); ++i) {
    TapRing& ring = tapes_[(turn_ + i) % tapes_.size()].ring;
    const TapRecord* const record = ring.front();
    if (record == nullptr) continue;
    held_ = &ring;
    // Each lane in turn, so that a busy one does not fill the others' rings.
    turn_ = (turn_ + i + 1) % tapes_.size();
    return call_of(*record);
  }
  return std::nullopt;
}

TapLosses ServerTap::losses() const noexcept {
  TapLosses losses;
  for (const LaneTape& tape : tapes_) {
    losses.dropped_count += tape.dropped_count.load(std::memory_order_relaxed);
    losses.omitted_payload_count += tape.omitted_payload_count.load(std::memory_order_relaxed);
  }
  return losses;
}

}  // namespace rtpm::rpc
