#pragma once

#include <atomic>
#include <mutex>

#include "rtpm/rt/pi_mutex.hpp"
#include "rtpm/transport/wait_set.hpp"

namespace rtpm::rpc {

/// Wakes a sleeping lane; costs only a load while the lane is awake. May outlive the lane.
/// @threads  wake(): any; the rest: the lane
/// @realtime alloc-free
class Doorbell {
 public:
  explicit Doorbell(transport::WaitSet& bell) noexcept : bell_(&bell) {}

  /// Call it after putting work into a list of the lane: either the lane sees the work before it
  /// sleeps, or this sees the lane asleep.
  void wake() noexcept {
    // SYNC POINT doorbell
    if (!is_asleep_.load(std::memory_order_seq_cst)) return;
    const std::lock_guard lock(ringing_);
    if (bell_ != nullptr) bell_->ring();
  }
  /// From here until end_sleep(), a wake() signals the lane. Check the lists after this call.
  void announce_sleep() noexcept {
    // SYNC POINT doorbell
    is_asleep_.store(true, std::memory_order_seq_cst);
  }
  void end_sleep() noexcept { is_asleep_.store(false, std::memory_order_relaxed); }
  /// Makes wake() a no-op when the lane ends.
  void close() noexcept {
    const std::lock_guard lock(ringing_);
    bell_ = nullptr;
  }

 private:
  std::atomic<bool> is_asleep_{false};
  rt::PiMutex ringing_;
  transport::WaitSet* bell_;
};

/// A queue from many threads to one consumer, linked through the elements' `next_ready`, a
/// std::atomic<T*>. An element may be in the queue only once.
/// @threads  push() and take_new(): any; the rest: the consumer
/// @realtime alloc-free, no lock
template <class T>
class ReadyList {
 public:
  void push(T& thing) noexcept {
    T* first = first_.load(std::memory_order_relaxed);
    do {
      thing.next_ready.store(first, std::memory_order_relaxed);
      // SYNC POINT ready-list: an element's content is written before it is published in the list.
    } while (!first_.compare_exchange_weak(first, &thing, std::memory_order_seq_cst,
                                           std::memory_order_relaxed));
  }
  [[nodiscard]] bool is_empty() const noexcept {
    return taken_ == nullptr && first_.load(std::memory_order_relaxed) == nullptr;
  }
  /// Whether the list is empty, sequentially consistent with Doorbell::announce_sleep().
  [[nodiscard]] bool is_empty_before_sleep() const noexcept {
    return taken_ == nullptr && first_.load(std::memory_order_seq_cst) == nullptr;
  }
  /// Takes the element that was pushed first, or null.
  [[nodiscard]] T* take_next() noexcept {
    if (taken_ == nullptr) taken_ = take_chain();
    T* const thing = taken_;
    if (thing != nullptr) taken_ = thing->next_ready.load(std::memory_order_relaxed);
    return thing;
  }
  /// Takes and visits, in push order, everything that take_next() has not returned.
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
  // Takes all elements, linked by their `next_ready` in push order.
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
  T* taken_ = nullptr;  ///< The elements that precede those in first_.
};

}  // namespace rtpm::rpc
