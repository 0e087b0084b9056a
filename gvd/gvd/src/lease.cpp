#include "rtpm/gvd/lease.hpp"

#include <array>
#include <span>

namespace rtpm::gvd {

std::optional<std::uint64_t> Lease::acquire() noexcept {
  if (holder() != kNobody) return std::nullopt;
  std::uint64_t id = kNobody;
  while (id == kNobody) {
    const std::array serial{serial_.fetch_add(1, std::memory_order_relaxed)};
    id = siphash_2_4(key_, std::as_bytes(std::span(serial)));
  }
  std::uint64_t nobody = kNobody;
  if (!holder_.compare_exchange_strong(nobody, id, std::memory_order_acq_rel)) return std::nullopt;
  return id;
}

bool Lease::renew(std::uint64_t id) noexcept {
  if (id == kNobody || holder() != id) return false;
  renewed_count_.fetch_add(1, std::memory_order_relaxed);
  return true;
}

bool Lease::release(std::uint64_t id) noexcept {
  return id != kNobody && holder_.compare_exchange_strong(id, kNobody, std::memory_order_acq_rel);
}

std::uint64_t Lease::step(MonotonicTime now) noexcept {
  std::uint64_t current = holder();
  const std::uint64_t renewed_count = renewed_count_.load(std::memory_order_relaxed);
  if (current != seen_holder_ || renewed_count != seen_renewed_count_) {
    seen_holder_ = current;
    seen_renewed_count_ = renewed_count;
    expires_ = now + duration_;
  } else if (current != kNobody && now >= expires_) {
    // It may have been released at this moment and acquired by another, whom this leaves alone.
    if (release(current)) expired_count_.fetch_add(1, std::memory_order_relaxed);
    current = holder();
  }
  return current;
}

void Lease::revoke() noexcept {
  holder_.store(kNobody, std::memory_order_release);
}

}  // namespace rtpm::gvd
