#include "broadcast/common_reader.hpp"

#include <algorithm>
#include <mutex>

#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/memory.hpp"

namespace rtpm::events {
namespace {

using namespace std::chrono_literals;

// The states of a seat.
constexpr std::uint32_t kClaimed = 1;
constexpr std::uint32_t kAwaited = 2;    // The consumer's own thread waits for it.
constexpr std::uint32_t kLookAgain = 4;  // The reader skipped the seat while it was claimed.

constexpr Duration kClaimLookInterval = 100ms;
// How long a handler may delay other consumers before their own threads take over.
constexpr Duration kGuardPatience = 100us;
// Under continuous load the guard checks less often.
constexpr Duration kGuardPatienceMax = 1ms;
// How many quick calls one slow call outweighs.
constexpr int kSlowCallWeight = 8;
constexpr int kSlownessMax = 3 * kSlowCallWeight;

struct Registry {
  std::mutex mutex{};
  std::vector<std::pair<CommonReader::Key, std::weak_ptr<CommonReader>>> readers{};
};

Registry& registry() {
  static Registry its;
  return its;
}

}  // namespace

void ReaderSeat::claim() noexcept {
  // SYNC POINT reader-seat: a new holder sees the writes of the last one.
  while ((state_.fetch_or(kClaimed, std::memory_order_acq_rel) & kClaimed) != 0) {
    if ((state_.fetch_or(kAwaited, std::memory_order_acq_rel) & kClaimed) != 0) {
      rest(rt::now() + kClaimLookInterval);
    }
  }
}

bool ReaderSeat::try_claim() noexcept {
  while ((state_.fetch_or(kClaimed, std::memory_order_acq_rel) & kClaimed) != 0) {
    if ((state_.fetch_or(kLookAgain, std::memory_order_acq_rel) & kClaimed) != 0) return false;
  }
  return true;
}

bool ReaderSeat::release() noexcept {
  // SYNC POINT reader-seat
  const std::uint32_t before = state_.exchange(0, std::memory_order_acq_rel);
  if ((before & kAwaited) != 0) call();
  return (before & kLookAgain) != 0;
}

void ReaderSeat::note_duration(Duration duration, MonotonicTime now) noexcept {
  if (duration <= CommonReader::kQuickMax) {
    slowness_ = std::max(0, slowness_ - 1);
    return;
  }
  slowness_ += kSlowCallWeight;
  if (duration >= CommonReader::kTooLong || slowness_ >= kSlownessMax) set_slow(now);
}

void ReaderSeat::set_slow(MonotonicTime now) noexcept {
  slowness_ = 0;
  if (now >= slow_until_) {
    const bool is_again = now < slow_until_ + CommonReader::kSlowSpanMax;
    slow_span_ = is_again ? std::min(2 * slow_span_, CommonReader::kSlowSpanMax)
                          : CommonReader::kSlowSpanFirst;
  }
  slow_until_ = now + slow_span_;
}

std::shared_ptr<CommonReader> CommonReader::of(const Key& key, const MakeSource& make) {
  Registry& its = registry();
  const std::lock_guard lock(its.mutex);
  std::erase_if(its.readers, [](const auto& each) { return each.second.expired(); });
  for (const auto& [known, reader] : its.readers) {
    if (known != key) continue;
    if (auto found = reader.lock()) return found;
  }
  auto source = make();
  if (!source) return nullptr;
  std::shared_ptr<CommonReader> reader(new CommonReader(key, std::move(source)));
  if (reader->source_->must_be_fetched() && !reader->start_threads()) return nullptr;
  its.readers.emplace_back(key, reader);
  return reader;
}

CommonReader::CommonReader(Key key, std::shared_ptr<ReaderSource> source)
    : key_(std::move(key)), source_(std::move(source)) {
  seats_.reserve(kSeatCountMax);
  served_.reserve(kSeatCountMax);
}

CommonReader::~CommonReader() {
  is_stopping_.store(true, std::memory_order_release);
  lead_call_.post();
  guard_call_.post();
  // The threads may sleep there; other sleepers wake spuriously.
  if (lead_.is_running()) source_->stop();
}

bool CommonReader::start_threads() {
  if (has_failed_) return false;
  if (guard_.is_running()) return true;
  const rt::AllowAllocationScope is_allowed;
  rt::ThreadConfig config{
      .name = "ev-reader", .priority = key_.priority, .cpus = key_.cpus, .realtime = key_.realtime};
  auto lead = rt::Thread::start(config, [this] { this->lead(); });
  if (lead) lead_ = std::move(*lead);
  config.name = "ev-guard";
  auto guard = lead ? rt::Thread::start(config, [this] { this->guard(); }) : std::move(lead);
  if (guard) guard_ = std::move(*guard);
  // The consumers' own threads continue to serve.
  has_failed_ = !guard_.is_running();
  return !has_failed_;
}

void CommonReader::join(const std::shared_ptr<ReaderSeat>& seat) {
  const std::lock_guard lock(mutex_);
  if (seats_.size() >= kSeatCountMax) return;
  seats_.push_back(seat);
  decide();
}

void CommonReader::leave(const std::shared_ptr<ReaderSeat>& seat) {
  const std::lock_guard lock(mutex_);
  std::erase(seats_, seat);
  decide();
}

// Requires the mutex; called after each change.
void CommonReader::decide() {
  std::uint32_t bits = 0;
  for (const auto& each : seats_)
    bits |= each->wake_bits();
  const std::uint32_t earlier_bits = wake_bits_.exchange(bits);
  version_.fetch_add(1, std::memory_order_release);
  // A reader that must fetch anyway serves even a single consumer.
  const std::size_t count_min = source_->must_be_fetched() ? 1 : kSeatCountMin;
  const bool serves = !is_dispersed_ && seats_.size() >= count_min && start_threads();
  if (serves_.exchange(serves, std::memory_order_acq_rel) != serves) {
    if (serves) {
      lead_call_.post();
      guard_call_.post();
    } else {
      for (const auto& each : seats_)
        each->call();
    }
    source_->interrupt_fetch();
  }
  // Wakes sleepers with outdated bits.
  if ((bits & ~earlier_bits) != 0 && serves) source_->ring(earlier_bits);
}

void CommonReader::lead() noexcept {
  while (!is_stopping_.load(std::memory_order_acquire)) {
    if (!serves()) {
      // Dispersed just after that handler had returned: resume.
      if (!gather(nullptr, MonotonicTime{})) static_cast<void>(lead_call_.wait_until(kNever));
      continue;
    }
    const std::uint32_t seen = source_->value();
    if (served_version_ != version_.load(std::memory_order_acquire)) take_over_seats();
    if (pass()) continue;
    done_.store(seen, std::memory_order_release);
    source_->fetch(seen, wake_bits_.load());
  }
}

void CommonReader::take_over_seats() noexcept {
  const rt::AllowAllocationScope is_allowed;
  const std::lock_guard lock(mutex_);
  served_ = seats_;
  served_version_ = version_.load(std::memory_order_relaxed);
}

// One delivery per consumer, so that a busy consumer does not delay the others.
bool CommonReader::pass() noexcept {
  bool has_delivered = false;
  last_time_ = rt::now();
  for (const auto& seat : served_) {
    if (seat->try_claim()) has_delivered = serve(*seat) || has_delivered;
  }
  return has_delivered;
}

bool CommonReader::serve(ReaderSeat& seat) noexcept {
  if (!seat.is_common()) {
    static_cast<void>(seat.release());
    return false;
  }
  call_.fetch_add(1, std::memory_order_acq_rel);
  const auto taking = seat.member().take_one();
  // SYNC POINT reader-call: either the guard sees the end of the call, or this sees the dispersal.
  call_.fetch_add(1, std::memory_order_seq_cst);
  if (taking == ReaderSeat::Member::Taking::kDelivered) {
    const MonotonicTime now = rt::now();
    seat.note_duration(now - last_time_, now);
    last_time_ = now;
    if (!serves()) static_cast<void>(gather(&seat, now));
    if (seat.is_slow(now)) seat.set_common(false);
  } else if (taking == ReaderSeat::Member::Taking::kApart) {
    seat.set_common(false);
  }
  // The consumer's own thread continues.
  const bool is_apart = !seat.is_common();
  const bool is_again = seat.release();
  if (is_apart) seat.call();
  return taking == ReaderSeat::Member::Taking::kDelivered || is_again;
}

// Ends a dispersal once the handler of `slow` has returned.
bool CommonReader::gather(ReaderSeat* slow, MonotonicTime now) noexcept {
  const std::lock_guard lock(mutex_);
  if (!std::exchange(is_dispersed_, false)) return false;
  if (slow != nullptr) slow->set_slow(now);
  decide();
  return true;
}

void CommonReader::guard() noexcept {
  Duration patience = kGuardPatience;
  while (!is_stopping_.load(std::memory_order_acquire)) {
    const std::uint32_t seen = source_->value();
    if (!serves()) {
      if (source_->must_be_fetched()) {
        source_->fetch(seen, ~0U);
      } else {
        static_cast<void>(guard_call_.wait_until(kNever));
      }
      continue;
    }
    if (done_.load(std::memory_order_acquire) != seen) {
      const std::uint64_t call = call_.load(std::memory_order_acquire);
      rt::sleep_until(rt::now() + patience);
      const bool is_same = call_.load(std::memory_order_acquire) == call;
      if (is_same && call % 2 == 1) {
        disperse(call);
        continue;
      }
      if (!is_same) {
        // Another handler is running.
        patience = std::min(2 * patience, kGuardPatienceMax);
        continue;
      }
    }
    patience = kGuardPatience;
    source_->sleep(seen, wake_bits_.load(), kNever);
  }
}

void CommonReader::disperse(std::uint64_t call) noexcept {
  const std::lock_guard lock(mutex_);
  // SYNC POINT reader-call
  if (is_dispersed_ || call_.load(std::memory_order_seq_cst) != call) return;
  is_dispersed_ = true;
  decide();
}

}  // namespace rtpm::events
