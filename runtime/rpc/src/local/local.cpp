#include "local/local.hpp"

#include <algorithm>
#include <cstring>
#include <map>
#include <mutex>
#include <utility>

#include "local/local_oneways.hpp"
#include "rtpm/base/assert.hpp"
#include "rtpm/rt/budget.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/memory.hpp"
#include "rtpm/rt/pi_mutex.hpp"

namespace rtpm::rpc {
namespace {

// Reading the clock takes longer than reading the state.
constexpr int kLooksPerGlance = 32;

struct Directory {
  rt::PiMutex mutex;
  std::map<std::uint64_t, std::weak_ptr<LocalDoor>> doors;
  /// Channels of destroyed nodes while a lane still runs one of their calls.
  std::vector<std::unique_ptr<LocalChannel>> orphans;
};

Directory& directory() {
  // Never destroyed: lanes with static lifetime may end after it.
  static auto* const instance = new Directory;
  return *instance;
}

// Session numbers on a wire are keyed hashes, so a collision with these is as unlikely as a guess.
std::atomic<std::uint64_t> session_serial{0xffff'ffff'0000'0000};

}  // namespace

LocalChannel::LocalChannel(std::uint32_t message_size_max)
    : request_(message_size_max),
      reply_(message_size_max),
      request_room_(request_.bytes()),
      reply_room_(reply_.bytes()) {
  // Pre-faults the part that most calls use.
  for (const MutableBytes bytes : {request_room_, reply_room_}) {
    if (!bytes.empty()) std::memset(bytes.data(), 0, std::min<std::size_t>(bytes.size(), 4096));
  }
}

void LocalChannel::give_up() noexcept {
  if (home_ != nullptr) return home_->give_back(*this);
  release();
}

bool LocalChannel::write(const LocalCallParameters& parameters, ConstBytes request) noexcept {
  const std::size_t room = std::min<std::size_t>(parameters.message_size_max, request_room_.size());
  // Without memory the reply buffer is empty.
  if (request.size() > room || reply_room_.size() < parameters.message_size_max) return false;
  parameters_ = parameters;
  request_size_ = request.size();
  if (!request.empty()) std::memcpy(request_room_.data(), request.data(), request.size());
  return true;
}

bool LocalChannel::wait(const rt::WaitConfig& how) noexcept {
  const bool is_endless = how.strategy == rt::WaitStrategy::kSpin;
  if (how.strategy != rt::WaitStrategy::kBlock) {
    MonotonicTime now = rt::now();
    const MonotonicTime spin_end =
        is_endless ? parameters_.deadline : std::min(parameters_.deadline, now + how.spin);
    do {
      for (int i = 0; i < kLooksPerGlance; ++i) {
        if (state_.load(std::memory_order_acquire) == State::kDone) return true;
      }
      now = rt::now();
    } while (now < spin_end && !rt::this_thread_budget().must_pause(now));
  }
  State state = State::kSubmitted;
  if (!state_.compare_exchange_strong(state, State::kWaiting, std::memory_order_acq_rel)) {
    return true;
  }
  if (!done_.wait_until(parameters_.deadline)) {
    state = State::kWaiting;
    if (state_.compare_exchange_strong(state, State::kLeft, std::memory_order_acq_rel)) {
      return false;
    }
    // The call ended just before the time-out: the signal is posted, or about to be.
    static_cast<void>(done_.wait_until(kNever));
  }
  // SYNC POINT local-done: the lane wrote the result before it set the state.
  return state_.load(std::memory_order_acquire) == State::kDone;
}

void LocalChannel::finish(wire::Status status, std::uint32_t size) noexcept {
  status_ = status;
  size_ = size;
  if (home_ != nullptr) return home_->give_back(*this);  // Its caller no longer waits.
  const State before = state_.exchange(State::kDone, std::memory_order_acq_rel);
  if (before == State::kWaiting) done_.post();
  if (before == State::kLeft) release();
}

LocalGate::LocalGate(std::shared_ptr<Doorbell> bell, LocalHost& host,
                     std::uint32_t oneway_count_max, std::uint32_t message_size_max) noexcept
    : bell_(std::move(bell)),
      host_(host),
      oneway_count_max_(oneway_count_max),
      message_size_max_(message_size_max) {}

LocalGate::~LocalGate() = default;

void LocalGate::submit(LocalChannel& call, bool is_awaited) noexcept {
  call.submit(is_awaited);
  calls_.push(call);
  // SYNC POINT local-gate: either the lane sees the call after closing the gate, or we see the gate
  // closed.
  if (is_closed_.load(std::memory_order_seq_cst)) {
    return calls_.take_new([](LocalChannel& each) { each.finish(wire::Status::kStopping, 0); });
  }
  bell_->wake();
}

void LocalGate::open_places() {
  const rt::AllowAllocationScope is_allowed;
  const std::lock_guard lock(opening_);
  if (places_ || oneway_count_max_ == 0) return;
  places_ = std::make_unique<LocalOneways>(oneway_count_max_, message_size_max_);
  // SYNC POINT local-places: they are complete.
  open_places_.store(places_.get(), std::memory_order_release);
}

bool LocalGate::has_places_for(std::size_t size) const noexcept {
  return oneway_count_max_ > 0 && size <= LocalOneways::kSizeMax;
}

LocalChannel* LocalGate::take_place() noexcept {
  // SYNC POINT local-places
  LocalOneways* places = open_places_.load(std::memory_order_acquire);
  if (places == nullptr) {
    open_places();
    places = open_places_.load(std::memory_order_acquire);
  }
  LocalChannel* const place = places->take();
  if (place != nullptr) return place;
  refused_count_.fetch_add(1, std::memory_order_seq_cst);
  bell_->wake();
  return nullptr;
}

std::uint32_t LocalGate::take_refused_count() noexcept {
  if (refused_count_.load(std::memory_order_relaxed) == 0) return 0;
  return refused_count_.exchange(0, std::memory_order_relaxed);
}

void LocalGate::close() noexcept {
  // SYNC POINT local-gate
  is_closed_.store(true, std::memory_order_seq_cst);
  while (LocalChannel* const call = take_next())
    call->finish(wire::Status::kStopping, 0);
}

LocalGate* LocalDoor::gate_of(Priority priority) const noexcept {
  if (priority > ceiling_) return nullptr;
  for (const Entry& entry : entries_) {
    if (entry.band.contains(priority)) return entry.gate.get();
  }
  return nullptr;
}

void LocalDoor::open_places(std::span<const Priority> priorities) const {
  for (const Entry& entry : entries_) {
    const bool is_wanted =
        priorities.empty() || std::ranges::any_of(priorities, [&](Priority priority) {
          return entry.band.contains(priority);
        });
    if (is_wanted) entry.gate->open_places();
  }
}

void LocalDoor::open(const std::shared_ptr<LocalDoor>& door) {
  Directory& all = directory();
  const std::lock_guard lock(all.mutex);
  all.doors[door->epoch_] = door;
}

void LocalDoor::close(const LocalDoor& door) noexcept {
  Directory& all = directory();
  const std::lock_guard lock(all.mutex);
  all.doors.erase(door.epoch_);
}

std::shared_ptr<LocalDoor> LocalDoor::find(std::uint64_t epoch) {
  Directory& all = directory();
  const std::lock_guard lock(all.mutex);
  const auto found = all.doors.find(epoch);
  return found == all.doors.end() ? nullptr : found->second.lock();
}

std::uint64_t LocalChannels::next_session() noexcept {
  return session_serial.fetch_add(1, std::memory_order_relaxed);
}

LocalChannels::LocalChannels(std::uint32_t count_max, std::uint32_t message_size_max)
    : message_size_max_(message_size_max), channels_(count_max) {}

LocalChannels::~LocalChannels() {
  Directory& all = directory();
  const std::lock_guard lock(all.mutex);
  std::erase_if(all.orphans, [](const auto& channel) { return channel->is_free(); });
  for (auto& channel : channels_) {
    if (channel && !channel->is_free()) all.orphans.push_back(std::move(channel));
  }
}

expected<LocalChannel*, CallError> LocalChannels::take() noexcept {
  // SYNC POINT local-channels: a counted channel is fully constructed.
  const std::size_t count = count_.load(std::memory_order_acquire);
  for (std::size_t i = 0; i < count; ++i) {
    if (channels_[i]->try_take()) return channels_[i].get();
  }
  const rt::AllowAllocationScope is_allowed;
  const std::lock_guard lock(adding_);
  const std::size_t index = count_.load(std::memory_order_relaxed);
  if (index == channels_.size()) return unexpected{CallError::kNoChannel};
  channels_[index] = std::make_unique<LocalChannel>(message_size_max_);
  const bool is_taken = channels_[index]->try_take();
  RTPM_ASSERT(is_taken, "no other thread knows a new channel");
  // SYNC POINT local-channels
  count_.store(index + 1, std::memory_order_release);
  return channels_[index].get();
}

}  // namespace rtpm::rpc
