#include "rtpm/gvd/command_lease.hpp"

#include <random>
#include <span>

namespace rtpm::gvd {

std::string_view to_string(LeaseState state) noexcept {
  switch (state) {
    case LeaseState::kUnknown:
      break;
    case LeaseState::kHeld:
      return "the lease is held";
    case LeaseState::kReleased:
      return "the lease was given back";
    case LeaseState::kSilent:
      return "the lease ended because its holder was silent";
    case LeaseState::kIdle:
      return "the lease ended because its holder sent no command for too long";
    case LeaseState::kTakenOver:
      return "an operator took the lease over";
    case LeaseState::kDeviceLost:
      return "the lease ended because the device was lost or stopped";
  }
  return "the device does not know the lease (any more)";
}

SipKey random_lease_key() {
  std::random_device random;
  const auto word = [&random] { return (std::uint64_t{random()} << 32) | std::uint64_t{random()}; };
  return {word(), word()};
}

void RateGate::step(MonotonicTime now) noexcept {
  if (is_open_.load(std::memory_order_acquire)) return;
  if (!opens_) opens_ = now + interval_;
  if (now < *opens_) return;
  opens_.reset();
  is_open_.store(true, std::memory_order_release);
}

std::uint64_t Lease::next_id() noexcept {
  constexpr std::uint64_t kSerialMask = 0xffff;
  std::uint64_t id = kNobody;
  // The random part is never zero, so no lease id equals kNobody.
  while ((id & ~kSerialMask) == 0) {
    const std::array serial{serial_.fetch_add(1, std::memory_order_relaxed)};
    id = (siphash_2_4(key_, std::as_bytes(std::span(serial))) & ~kSerialMask) |
         (serial[0] & kSerialMask);
  }
  Record& record = records_[serial_of(id) % kRememberedCount];
  record.id.store(kNobody, std::memory_order_release);
  record.state.store(LeaseState::kHeld, std::memory_order_release);
  record.id.store(id, std::memory_order_release);
  return id;
}

void Lease::remember(std::uint64_t id, LeaseState state) noexcept {
  Record& record = records_[serial_of(id) % kRememberedCount];
  if (record.id.load(std::memory_order_acquire) == id) {
    record.state.store(state, std::memory_order_release);
  }
}

std::optional<std::uint64_t> Lease::acquire() noexcept {
  if (holder() != kNobody || !acquire_gate_.take()) return std::nullopt;
  const std::uint64_t id = next_id();
  std::uint64_t nobody = kNobody;
  // Fails only after a concurrent take-over, as the gate admits one acquire() at a time.
  if (!holder_.compare_exchange_strong(nobody, id, std::memory_order_acq_rel)) return std::nullopt;
  return id;
}

std::optional<std::uint64_t> Lease::take_over() noexcept {
  if (!take_over_gate_.take()) return std::nullopt;
  const std::uint64_t id = next_id();
  operator_.store(id, std::memory_order_release);
  const std::uint64_t former = holder_.exchange(id, std::memory_order_acq_rel);
  if (former != kNobody) {
    remember(former, LeaseState::kTakenOver);
    taken_over_count_.fetch_add(1, std::memory_order_relaxed);
  }
  return id;
}

bool Lease::renew(std::uint64_t id) noexcept {
  if (id == kNobody || holder() != id) return false;
  renewed_count_.fetch_add(1, std::memory_order_relaxed);
  return true;
}

bool Lease::use(std::uint64_t id) noexcept {
  if (!renew(id)) return false;
  used_count_.fetch_add(1, std::memory_order_relaxed);
  return true;
}

bool Lease::end(std::uint64_t id, LeaseState state) noexcept {
  if (id == kNobody || !holder_.compare_exchange_strong(id, kNobody, std::memory_order_acq_rel)) {
    return false;
  }
  remember(id, state);
  return true;
}

bool Lease::release(std::uint64_t id) noexcept {
  return end(id, LeaseState::kReleased);
}

std::uint64_t Lease::step(MonotonicTime now) noexcept {
  acquire_gate_.step(now);
  take_over_gate_.step(now);
  const std::uint64_t current = holder();
  const std::uint64_t renewed_count = renewed_count_.load(std::memory_order_relaxed);
  const std::uint64_t used_count = used_count_.load(std::memory_order_relaxed);
  const bool is_new = current != seen_holder_;
  const bool is_operators = current == operator_.load(std::memory_order_acquire);
  const LeaseConfig times = is_operators ? config_.of_operator() : config_;
  if (is_new || renewed_count != seen_renewed_count_) expires_ = now + times.silence_max;
  if (is_new || used_count != seen_used_count_) idles_ = now + times.idle_max;
  seen_holder_ = current;
  seen_renewed_count_ = renewed_count;
  seen_used_count_ = used_count;
  // A concurrent release() and acquire() by another client stays in force.
  if (now >= expires_) {
    if (end(current, LeaseState::kSilent)) expired_count_.fetch_add(1, std::memory_order_relaxed);
  } else if (now >= idles_) {
    if (end(current, LeaseState::kIdle)) idle_count_.fetch_add(1, std::memory_order_relaxed);
  } else {
    return current;
  }
  return holder();
}

void Lease::revoke() noexcept {
  const std::uint64_t former = holder_.exchange(kNobody, std::memory_order_acq_rel);
  if (former != kNobody) remember(former, LeaseState::kDeviceLost);
}

LeaseState Lease::state_of(std::uint64_t id) const noexcept {
  if (id == kNobody) return LeaseState::kUnknown;
  if (holder() == id) return LeaseState::kHeld;
  const Record& record = records_[serial_of(id) % kRememberedCount];
  const LeaseState state = record.state.load(std::memory_order_acquire);
  // kHeld: the lease is just ending, and the reason is not stored yet.
  if (record.id.load(std::memory_order_acquire) != id || state == LeaseState::kHeld) {
    return LeaseState::kUnknown;
  }
  return state;
}

}  // namespace rtpm::gvd
