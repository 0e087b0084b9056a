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
  std::array<double, driver::kJointCountMax> velocities{};       ///< When the joint last moved.
  std::array<MonotonicTime, driver::kJointCountMax> moved_at{};  ///< Times of these moves.
  std::uint32_t buttons = 0;
  std::array<std::uint16_t, driver::kButtonCountMax> edges{};
  MonotonicTime time{};             ///< The newest report's time.
  std::uint64_t report_count = 0;   ///< Reports completed.
  std::uint64_t clamped_count = 0;  ///< Values outside of their range, which were clamped.
  std::uint64_t corrupt_count = 0;  ///< Meaningless events, which were dropped.
  std::uint64_t lost_count = 0;     ///< How often the kernel dropped events.
};

/// Accumulates events into a state. A report's events take effect together, with its SYN_REPORT.
/// After SYN_DROPPED, libevdev catches up with the kernel by events up to the next SYN_REPORT.
/// @threads  one at a time
/// @realtime alloc-free, except construction
class Accumulator {
 public:
  /// A joint that has not moved for longer stands still.
  static constexpr Duration kStillAfter = std::chrono::milliseconds{50};
  /// A larger step of a relative axis in one event is clamped to it.
  static constexpr std::int32_t kStepMax = 32'767;

  /// @param before  state of the same device before it was gone: relative axes and edges go on
  Accumulator(const Layout& layout, const Capabilities& capabilities, const State& before,
              MonotonicTime now);

  /// @param now  an event of a later time is taken to be of this time
  void apply(const Event& event, MonotonicTime now) noexcept;
  /// The state as of the last complete report; its counts of faults are up to date.
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
/// @param now  the present cycle's time
/// @realtime alloc-free
void fill(driver::Sample& sample, const State& state, const Layout& layout,
          MonotonicTime now) noexcept;

}  // namespace rtpm::device_evdev
