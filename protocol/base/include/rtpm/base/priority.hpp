#pragma once

#include <compare>
#include <cstdint>

#include "rtpm/base/assert.hpp"

namespace rtpm::inline base {

/// How urgent a call is: 0 (least) to 32767 (most), the same on every host whatever its operating
/// system's own levels are. The range is RT-CORBA's.
class Priority {
 public:
  static constexpr int kLowest = 0;
  static constexpr int kHighest = 32767;

  constexpr Priority() noexcept = default;
  /// A number outside 0…32767 is the caller's bug and aborts; check what comes from outside first.
  // NOLINTNEXTLINE(google-explicit-constructor): `.priority = 24000` is how people write it.
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

/// The priorities from `low` to `high`, both included, that one lane serves.
struct Band {
  Priority low = Priority::kLowest;
  Priority high = Priority::kHighest;

  [[nodiscard]] constexpr bool contains(Priority priority) const noexcept {
    return low <= priority && priority <= high;
  }
  friend constexpr bool operator==(Band, Band) noexcept = default;
};

}  // namespace rtpm::inline base
