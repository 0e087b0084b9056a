#pragma once

#include <array>
#include <cstddef>

#include "rtpm/base/time.hpp"

namespace rtpm::servo {

/// Returns values a fixed time after they were put in.
/// @ownership holds at most `Capacity` values in place; beyond that, the oldest are lost
/// @threads  one at a time
/// @realtime alloc-free
template <class T, std::size_t Capacity>
class DelayLine {
 public:
  explicit DelayLine(Duration delay) noexcept : delay_(delay) {}

  /// Puts `value` in. Returns the newest value that is at least the delay old; before the first,
  /// T{}. `now` must not decrease.
  T pass(MonotonicTime now, const T& value) noexcept {
    if (count_ == Capacity) drop_oldest();
    entries_[(oldest_ + count_++) % Capacity] = {now, value};
    while (count_ > 0 && now - entries_[oldest_].put_at >= delay_) {
      out_ = entries_[oldest_].value;
      drop_oldest();
    }
    return out_;
  }

 private:
  struct Entry {
    MonotonicTime put_at{};
    T value{};
  };

  void drop_oldest() noexcept {
    oldest_ = (oldest_ + 1) % Capacity;
    --count_;
  }

  Duration delay_;
  std::array<Entry, Capacity> entries_{};
  std::size_t oldest_ = 0;
  std::size_t count_ = 0;
  T out_{};
};

}  // namespace rtpm::servo
