#pragma once

#include <compare>
#include <cstdint>

#include "rtpm/base/assert.hpp"

namespace rtpm::inline base {

/// The urgency of a call: 0 (least) to 32767 (most), independent of the native levels of a host.
/// @source   RT-CORBA's range
class Priority {
 public:
  static constexpr int kLowest = 0;
  static constexpr int kHighest = 32767;

  constexpr Priority() noexcept = default;
  /// Aborts if `value` is outside 0…32767: check untrusted numbers with is_valid() first.
  // NOLINTNEXTLINE(google-explicit-constructor): users write `.priority = 24000`.
  constexpr Priority(int value) noexcept : value_(static_cast<std::uint16_t>(value)) {
    RTPM_ASSERT(is_valid(value), "a priority is 0 to 32767");
  }

  [[nodiscard]] static constexpr bool is_valid(std::int64_t value) noexcept {
    return value >= kLowest && value <= kHighest;
  }
  [[nodiscard]] constexpr std::uint16_t value() const noexcept { return value_; }
  friend constexpr auto operator<=>(Priority, Priority) noexcept = default;

 private:
  std::uint16_t value_ = 0;
};

/// The priorities that a lane serves: from `low` to `high`, inclusive.
struct Band {
  Priority low = Priority::kLowest;
  Priority high = Priority::kHighest;

  [[nodiscard]] constexpr bool contains(Priority priority) const noexcept {
    return low <= priority && priority <= high;
  }
  friend constexpr bool operator==(Band, Band) noexcept = default;
};

}  // namespace rtpm::inline base
