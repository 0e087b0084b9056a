#pragma once

#include <atomic>
#include <mutex>

#include "rtpm/rt/pi_mutex.hpp"
#include "rtpm/transport/wait_set.hpp"

namespace rtpm::rpc {

/// Wakes a lane that sleeps; costs a load while it does not. May outlive the lane.
/// @threads  wake() any; everything else the lane's
/// @realtime alloc-free
class Doorbell {
 public:
  explicit Doorbell(transport::WaitSet& bell) noexcept : bell_(&bell) {}

  /// The caller has put its work into a list of the lane before: either the lane sees it before it
  /// sleeps, or this sees the lane asleep.
  void wake() noexcept {
    // SYNC POINT doorbell
    if (!is_asleep_.load(std::memory_order_seq_cst)) return;
    const std::lock_guard lock(ringing_);
    if (bell_ != nullptr) bell_->ring();
  }
  /// From here on until end_sleep() a wake() rings. Check the lists after it.
  void announce_sleep() noexcept {
    // SYNC POINT doorbell
    is_asleep_.store(true, std::memory_order_seq_cst);
  }
  void end_sleep() noexcept { is_asleep_.store(false, std::memory_order_relaxed); }
  /// The lane ends: no thread rings it any more.
  void close() noexcept {
    const std::lock_guard lock(ringing_);
    bell_ = nullptr;
  }

 private:
  std::atomic<bool> is_asleep_{false};
  rt::PiMutex ringing_;
  transport::WaitSet* bell_;
};

/// Things that any thread hands to one that takes them in order; linked through their `next_ready`,
/// a std::atomic<T*>. A thing stands in it once at a time.
/// @threads  push() and take_new() any; the rest the one that takes
/// @realtime alloc-free, no lock
template <class T>
class ReadyList {
 public:
  void push(T& thing) noexcept {
    T* first = first_.load(std::memory_order_relaxed);
    do {
      thing.next_ready.store(first, std::memory_order_relaxed);
      // SYNC POINT ready-list: what the thing has is written before it stands in the list.
    } while (!first_.compare_exchange_weak(first, &thing, std::memory_order_seq_cst,
                                           std::memory_order_relaxed));
  }
  [[nodiscard]] bool is_empty() const noexcept {
    return taken_ == nullptr && first_.load(std::memory_order_relaxed) == nullptr;
  }
  /// Whether the list is empty, in one order with Doorbell::announce_sleep().
  [[nodiscard]] bool is_empty_before_sleep() const noexcept {
    return taken_ == nullptr && first_.load(std::memory_order_seq_cst) == nullptr;
  }
  /// The one that was pushed first, or null.
  [[nodiscard]] T* take_next() noexcept {
    if (taken_ == nullptr) taken_ = take_chain();
    T* const thing = taken_;
    if (thing != nullptr) taken_ = thing->next_ready.load(std::memory_order_relaxed);
    return thing;
  }
  /// Takes and visits, the first pushed first, all that take_next() has not come to.
  template <class Visitor>
  void take_new(Visitor visit) noexcept {
    T* first = take_chain();
    while (first != nullptr) {
      T& thing = *first;
      first = thing.next_ready.load(std::memory_order_relaxed);
      visit(thing);
    }
  }

 private:
  // All, linked by their `next_ready`, the first pushed first.
  [[nodiscard]] T* take_chain() noexcept {
    // SYNC POINT ready-list
    T* newest = first_.exchange(nullptr, std::memory_order_seq_cst);
    T* first = nullptr;
    while (newest != nullptr) {
      T* const next = newest->next_ready.load(std::memory_order_relaxed);
      newest->next_ready.store(first, std::memory_order_relaxed);
      first = newest;
      newest = next;
    }
    return first;
  }

  std::atomic<T*> first_{nullptr};
  T* taken_ = nullptr;  ///< The things that came before those in first_.
};

}  // namespace rtpm::rpc
