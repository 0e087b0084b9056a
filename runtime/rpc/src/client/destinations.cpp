#include "client/destinations.hpp"

#include <mutex>

#include "client/node_impl.hpp"
#include "rtpm/base/assert.hpp"

namespace rtpm::rpc {

Destination::~Destination() {
  node.impl().give_back(endpoint);
}

Bound Destinations::get() noexcept {
  if (const auto value = bound_.read()) return *value;
  // A reader may be overtaken by repeated writes; the lock prevents that.
  const std::lock_guard lock(writing_);
  const auto value = bound_.read();
  RTPM_ASSERT(value.has_value(), "a binding was bound before its first call");
  return *value;
}

void Destinations::renew(const Bound& value) noexcept {
  const std::lock_guard lock(writing_);
  if (value.destination == current_) bound_.write(value);
}

void Destinations::settle(std::unique_ptr<Destination> destination, const Bound& bound) {
  has_door_.store(destination->door != nullptr, std::memory_order_relaxed);
  // Outside the lock, which a more urgent thread may wait for.
  former_.reserve(former_.size() + 1);
  const std::lock_guard lock(writing_);
  if (settled_) {
    destination->lost_before = settled_->lost_oneway_count();
    destination->lost_elsewhere = destination->endpoint.lost_oneway_count();
    former_.push_back(std::move(settled_));
  } else {
    lost_oneways_told_ = destination->lost_oneway_count();
  }
  settled_ = std::move(destination);
  current_ = settled_.get();
  bound_.write(bound);
}

bool Destinations::free_former() noexcept {
  if (former_.empty()) return true;
  // SYNC POINT binding-destinations: a pin taken after this check sees the newest destination.
  if (pin_count_.fetch_add(0, std::memory_order_acq_rel) > 0) return false;
  former_.clear();
  return true;
}

bool Destinations::has_lost_oneways() noexcept {
  const Pin pin(*this);
  const std::uint64_t count = get().destination->lost_oneway_count();
  std::uint64_t told = lost_oneways_told_.load(std::memory_order_relaxed);
  // Only one of the threads that see the loss reports it.
  while (told < count) {
    if (lost_oneways_told_.compare_exchange_weak(told, count, std::memory_order_relaxed)) {
      return sends_oneways_.load(std::memory_order_relaxed);
    }
  }
  return false;
}

}  // namespace rtpm::rpc
