#include "rtpm/device_evdev/accumulator.hpp"

#include <linux/input.h>

#include <algorithm>
#include <cmath>

namespace rtpm::device_evdev {
namespace {

static_assert(ABS_CNT <= 0x40 && REL_CNT <= 0x10 && KEY_CNT <= 0x300);

/// A USB device sends at most 8000 reports per second.
constexpr Duration kReportPeriodMin = std::chrono::microseconds{125};

}  // namespace

Accumulator::Accumulator(const Layout& layout, const Capabilities& capabilities,
                         const State& before, MonotonicTime now)
    : analogs_(layout.analogs), joints_(layout.joints) {
  for (auto* const table : {&analog_of_, &wheel_of_})
    table->fill(kNone);
  joint_of_.fill(kNone);
  button_of_.fill(kNone);
  pending_.edges = before.edges;
  pending_.buttons = before.buttons;
  const auto present = [&](std::uint16_t code) {
    const auto axis = std::ranges::find(capabilities.absolute, code, &AbsoluteAxis::code);
    return axis == capabilities.absolute.end() ? 0 : axis->value;
  };
  for (std::size_t i = 0; i < analogs_.size(); ++i) {
    analog_of_[analogs_[i].axis.code] = static_cast<std::int8_t>(i);
    pending_.analogs[i] = analog_value(analogs_[i], present(analogs_[i].axis.code));
  }
  for (std::size_t i = 0; i < joints_.size(); ++i) {
    const JointChannel& joint = joints_[i];
    (joint.axis ? wheel_of_[joint.code] : joint_of_[joint.code]) = static_cast<std::int8_t>(i);
    pending_.joints[i] = joint.axis ? wheel_position(joint, present(joint.code)) : before.joints[i];
  }
  for (std::size_t i = 0; i < layout.buttons.size(); ++i) {
    button_of_[layout.buttons[i]] = static_cast<std::int8_t>(i);
    const bool is_down = std::ranges::count(capabilities.pressed, layout.buttons[i]) > 0;
    set_key(layout.buttons[i], is_down ? 1 : 0);
  }
  pending_.moved_at.fill(now);
  pending_.time = now;
  complete_ = pending_;
}

/// Also increments the counter in the complete state, because the end of the report may be lost.
void Accumulator::count(std::uint64_t State::*counter) noexcept {
  complete_.*counter = ++(pending_.*counter);
}

void Accumulator::apply(const Event& event, MonotonicTime now) noexcept {
  const MonotonicTime time = std::min(event.time, now);
  switch (event.type) {
    case EV_SYN:
      if (event.code == SYN_REPORT) complete(time);
      if (event.code == SYN_DROPPED) count(&State::lost_count);
      return;
    case EV_ABS:
      if (event.code < kAbsoluteCount) return set_absolute(event.code, event.value);
      break;
    case EV_REL:
      if (event.code < kRelativeCount) return add_relative(event.code, event.value);
      break;
    case EV_KEY:
      if (event.code < kKeyCount && event.value >= 0 && event.value <= 2) {
        return set_key(event.code, event.value);
      }
      break;
    default:
      // Ignores events of other types, such as scan codes and echoes of effects.
      if (event.type < EV_CNT) return;
  }
  count(&State::corrupt_count);
}

void Accumulator::set_absolute(std::uint16_t code, std::int32_t value) noexcept {
  const auto note_range = [&](const AbsoluteAxis& axis) {
    if (value < axis.minimum || value > axis.maximum) count(&State::clamped_count);
  };
  if (const std::int8_t analog = analog_of_[code]; analog != kNone) {
    const auto index = static_cast<std::size_t>(analog);
    note_range(analogs_[index].axis);
    pending_.analogs[index] = analog_value(analogs_[index], value);
  }
  if (const std::int8_t wheel = wheel_of_[code]; wheel != kNone) {
    const auto index = static_cast<std::size_t>(wheel);
    note_range(*joints_[index].axis);
    pending_.joints[index] = wheel_position(joints_[index], value);
  }
}

void Accumulator::add_relative(std::uint16_t code, std::int32_t step) noexcept {
  const std::int8_t joint = joint_of_[code];
  if (joint == kNone) return;
  const std::int32_t clamped = std::clamp(step, -kStepMax, kStepMax);
  if (clamped != step) count(&State::clamped_count);
  const auto index = static_cast<std::size_t>(joint);
  pending_.joints[index] += clamped * joints_[index].scale;
}

/// A repeat (value 2) is handled as a press of a key that is already down.
void Accumulator::set_key(std::uint16_t code, std::int32_t value) noexcept {
  const std::int8_t button = button_of_[code];
  if (button == kNone) return;
  const std::uint32_t bit = 1u << static_cast<unsigned>(button);
  const bool was_down = (pending_.buttons & bit) != 0;
  if (was_down == (value != 0)) return;
  pending_.buttons ^= bit;
  ++pending_.edges[static_cast<std::size_t>(button)];
}

void Accumulator::complete(MonotonicTime time) noexcept {
  pending_.time = std::max(time, complete_.time);
  for (std::size_t i = 0; i < joints_.size(); ++i) {
    const double step = pending_.joints[i] - complete_.joints[i];
    if (step == 0) continue;
    const Duration elapsed =
        std::clamp(pending_.time - pending_.moved_at[i], kReportPeriodMin, kStillAfter);
    pending_.velocities[i] = step / std::chrono::duration<double>(elapsed).count();
    pending_.moved_at[i] = pending_.time;
  }
  ++pending_.report_count;
  complete_ = pending_;
}

void fill(driver::Sample& sample, const State& state, const Layout& layout,
          MonotonicTime now) noexcept {
  std::copy_n(state.analogs.begin(), layout.analogs.size(), sample.analogs.begin());
  for (std::size_t i = 0; i < layout.joints.size(); ++i) {
    const bool is_still = now - state.moved_at[i] > Accumulator::kStillAfter;
    sample.joints[i] = state.joints[i];
    sample.joint_velocities[i] = is_still ? 0 : state.velocities[i];
  }
  sample.buttons = state.buttons;
  sample.button_edges = state.edges;
}

}  // namespace rtpm::device_evdev
