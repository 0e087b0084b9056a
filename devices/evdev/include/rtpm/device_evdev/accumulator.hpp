#pragma once

#include <array>
#include <cstdint>

#include "rtpm/device_evdev/event.hpp"
#include "rtpm/device_evdev/layout.hpp"
#include "rtpm/driver/sample.hpp"

namespace rtpm::device_evdev {

/// A device's state, accumulated from its events.
/// @ownership plain value, trivially copyable
struct State {
  std::array<float, driver::kAnalogCountMax> analogs{};
  std::array<double, driver::kJointCountMax> joints{};
  /// Each joint's velocity when it last moved.
  std::array<double, driver::kJointCountMax> velocities{};
  std::array<MonotonicTime, driver::kJointCountMax> moved_at{};  ///< When each joint last moved.
  std::uint32_t buttons = 0;
  std::array<std::uint16_t, driver::kButtonCountMax> edges{};
  MonotonicTime time{};             ///< The time of the newest report.
  std::uint64_t report_count = 0;   ///< Number of completed reports.
  std::uint64_t clamped_count = 0;  ///< Number of out-of-range values, which were clamped.
  std::uint64_t corrupt_count = 0;  ///< Number of meaningless events, which were dropped.
  std::uint64_t lost_count = 0;     ///< How many times the kernel dropped events.
};

/// Accumulates events into a state. The events of one report take effect together, at its
/// SYN_REPORT. After SYN_DROPPED, libevdev sends the differences to the kernel's state, up to the
/// next SYN_REPORT.
/// @threads  one at a time
/// @realtime alloc-free, except for construction
class Accumulator {
 public:
  /// A joint counts as not moving if it has not moved for longer than this.
  static constexpr Duration kStillAfter = std::chrono::milliseconds{50};
  /// A relative axis moves at most this far per event; more is clamped.
  static constexpr std::int32_t kStepMax = 32'767;

  /// @param before  the same device's state before it was unplugged: relative axes and edge counts
  ///           continue from it
  Accumulator(const Layout& layout, const Capabilities& capabilities, const State& before,
              MonotonicTime now);

  /// @param now  the current time; replaces the time of an event from the future
  void apply(const Event& event, MonotonicTime now) noexcept;
  /// The state at the last complete report; its fault counters are always up to date.
  [[nodiscard]] const State& state() const noexcept { return complete_; }

 private:
  static constexpr std::size_t kAbsoluteCount = 0x40;
  static constexpr std::size_t kRelativeCount = 0x10;
  static constexpr std::size_t kKeyCount = 0x300;
  static constexpr std::int8_t kNone = -1;

  void count(std::uint64_t State::*counter) noexcept;
  void set_absolute(std::uint16_t code, std::int32_t value) noexcept;
  void add_relative(std::uint16_t code, std::int32_t step) noexcept;
  void set_key(std::uint16_t code, std::int32_t value) noexcept;
  void complete(MonotonicTime time) noexcept;

  std::array<std::int8_t, kAbsoluteCount> analog_of_{};
  std::array<std::int8_t, kAbsoluteCount> wheel_of_{};
  std::array<std::int8_t, kRelativeCount> joint_of_{};
  std::array<std::int8_t, kKeyCount> button_of_{};
  std::vector<AnalogChannel> analogs_;
  std::vector<JointChannel> joints_;
  State pending_{};
  State complete_{};
};

/// Fills the channels that the layout names.
/// @param now  the time of the current cycle
/// @realtime alloc-free
void fill(driver::Sample& sample, const State& state, const Layout& layout,
          MonotonicTime now) noexcept;

}  // namespace rtpm::device_evdev
