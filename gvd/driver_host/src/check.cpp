#include "rtpm/driver_host/check.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <set>
#include <sstream>

#include "driver_trial.hpp"

namespace rtpm::driver_host {
namespace {

using driver::CommandMode;
using driver::ExchangeStatus;
using driver::Vector3;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

double length(const Vector3& v) {
  return std::hypot(v.x, v.y, v.z);
}
bool is_finite(const Vector3& v) {
  return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}
std::string text_of(const Vector3& v) {
  std::ostringstream text;
  text << '(' << v.x << ", " << v.y << ", " << v.z << ')';
  return text.str();
}

void describes_axes_and_limits(DriverTrial& trial, const driver::Descriptor& descriptor) {
  const driver::Limits& limits = descriptor.limits;
  for (const double limit : {limits.force_newton_max, limits.torque_newton_metre_max,
                             limits.stiffness_newton_per_m_max, limits.damping_newton_s_per_m}) {
    trial.expect(std::isfinite(limit) && limit >= 0, "a limit is negative or not finite");
  }
  const std::set<std::string> axis_names{"x", "y", "z", "rx", "ry", "rz"};
  std::set<std::string> seen;
  bool is_actuated = false;
  for (const driver::Axis& axis : descriptor.axes) {
    trial.expect(axis_names.contains(axis.name), "axis '" + axis.name + "' is none of x to rz");
    trial.expect(seen.insert(axis.name).second, "axis '" + axis.name + "' is there twice");
    is_actuated = is_actuated || axis.is_actuated;
  }
  trial.expect(is_actuated == (limits.force_newton_max > 0 || limits.torque_newton_metre_max > 0),
               "an actuated axis and a limit of force or torque need each other");
  trial.expect(std::ranges::count(descriptor.modes, CommandMode::kForce) == (is_actuated ? 1 : 0),
               "mode kForce is listed once by a device with an actuated axis, else not");
}

void describes_itself_whole(DriverTrial& trial) {
  const driver::Descriptor descriptor = trial.driver->describe();
  trial.expect(!descriptor.model.empty(), "model is empty");
  trial.expect(!descriptor.serial.empty(), "serial is empty");
  trial.expect(!descriptor.frame.empty(), "frame is empty");
  trial.expect(descriptor.rate_hz > 0, "rate_hz is not above 0");
  trial.expect(descriptor.buttons.size() <= driver::kButtonCountMax, "there are too many buttons");
  trial.expect(descriptor.analogs.size() <= driver::kAnalogCountMax, "there are too many analogs");
  trial.expect(descriptor.joints.size() <= driver::kJointCountMax, "there are too many joints");
  trial.expect(descriptor.outputs.size() <= driver::kOutputCountMax, "there are too many outputs");
  trial.expect(descriptor.position_resolution_m >= 0, "position_resolution_m is below 0");
  const driver::Workspace& box = descriptor.workspace;
  trial.expect(
      box.low_m.x <= box.high_m.x && box.low_m.y <= box.high_m.y && box.low_m.z <= box.high_m.z,
      "the workspace's low corner is above its high one");
  describes_axes_and_limits(trial, descriptor);
  for (const driver::Joint& joint : descriptor.joints) {
    trial.expect(!joint.name.empty(), "a joint has no name");
    trial.expect(joint.unit == "rad" || joint.unit == "m",
                 "joint '" + joint.name + "' has the unit '" + joint.unit + "', not rad or m");
    trial.expect(joint.low <= joint.high, "joint '" + joint.name + "' has low above high");
  }
  for (const driver::Output& output : descriptor.outputs) {
    trial.expect(!output.name.empty() && !output.unit.empty(), "an output has no name or no unit");
    trial.expect(output.low <= output.safe && output.safe <= output.high,
                 "output '" + output.name + "' has its safe value outside of its range");
  }
}

void describes_itself_the_same_in_every_state(DriverTrial& trial) {
  const driver::Descriptor before = trial.driver->describe();
  if (!trial.start()) return;
  const driver::Descriptor during = trial.driver->describe();
  trial.expect(before.serial == during.serial && before.frame == during.frame &&
                   before.limits.force_newton_max == during.limits.force_newton_max &&
                   before.buttons == during.buttons,
               "describe() differs before and after activate()");
}

void refuses_a_period_of_nothing_in_words(DriverTrial& trial) {
  const auto configured = trial.driver->configure({.period = Duration{0}});
  trial.expect(!configured, "configure() takes a period of 0");
  trial.expect(configured || configured.error().text().size() > 20,
               "configure() refuses a period of 0 without a sentence");
}

void expect_channels(DriverTrial& trial, const driver::Descriptor& descriptor) {
  const driver::Sample& sample = trial.sample;
  for (std::size_t i = 0; i < descriptor.joints.size(); ++i) {
    const std::string joint = "joint '" + descriptor.joints[i].name + "'";
    trial.expect(std::isfinite(sample.joints[i]) && std::isfinite(sample.joint_velocities[i]),
                 joint + " is not finite");
    trial.expect(std::abs(sample.efforts_applied[i]) <= descriptor.joints[i].effort_max,
                 joint + " applies more than its effort_max");
  }
  for (std::size_t i = 0; i < descriptor.outputs.size(); ++i) {
    const double value = static_cast<double>(sample.outputs_applied[i]);
    trial.expect(value >= descriptor.outputs[i].low && value <= descriptor.outputs[i].high,
                 "output '" + descriptor.outputs[i].name + "' is outside of its range");
  }
  for (std::size_t i = 0; i < descriptor.analogs.size(); ++i) {
    const double value = static_cast<double>(sample.analogs[i]);
    trial.expect(value >= descriptor.analogs[i].low && value <= descriptor.analogs[i].high,
                 "analog '" + descriptor.analogs[i].name + "' is outside of its range");
  }
}

/// Joints and outputs stay in range for any numbers in a command.
void keeps_joints_and_outputs_within_its_descriptor(DriverTrial& trial) {
  if (!trial.start()) return;
  const driver::Descriptor descriptor = trial.driver->describe();
  for (const CommandMode mode : {CommandMode::kJointPosition, CommandMode::kJointVelocity,
                                 CommandMode::kJointEffort, CommandMode::kOutputs}) {
    for (const double value : {0.0, 0.01, -1e9, 1e308, kNan}) {
      driver::Setpoint setpoint;
      setpoint.mode = mode;
      setpoint.joints.fill(value);
      setpoint.outputs.fill(static_cast<float>(value));
      if (!trial.expect_ok(trial.exchange(setpoint))) return;
      expect_channels(trial, descriptor);
    }
  }
}

void expect_edges(DriverTrial& trial, const driver::Sample& before) {
  const driver::Sample& sample = trial.sample;
  for (std::size_t i = 0; i < driver::kButtonCountMax; ++i) {
    const unsigned changed = (sample.buttons ^ before.buttons) >> i & 1U;
    const auto step = static_cast<std::uint16_t>(sample.button_edges[i] - before.button_edges[i]);
    trial.expect(step % 2U == changed,
                 "the edges of button " + std::to_string(i) + " do not fit its state");
  }
}

void gives_finite_samples_with_times_that_grow(DriverTrial& trial) {
  if (!trial.start()) return;
  const driver::Descriptor descriptor = trial.driver->describe();
  driver::Sample before;
  before.host_time = MonotonicTime{};
  for (int i = 0; i < 3000 && !trial.is_over(); ++i) {
    if (!trial.expect_ok(trial.exchange(CommandMode::kOff))) return;
    const driver::Sample& sample = trial.sample;
    trial.expect(is_finite(sample.pose.position_m) && is_finite(sample.twist.linear_m_per_s) &&
                     is_finite(sample.twist.angular_rad_per_s),
                 "pose or twist is not finite");
    const driver::Quaternion& turn = sample.pose.orientation;
    const double norm = std::hypot(std::hypot(turn.x, turn.y), std::hypot(turn.z, turn.w));
    trial.expect(std::abs(norm - 1) <= 1e-6, "the orientation is no unit quaternion");
    trial.expect(sample.host_time >= before.host_time, "host_time goes back");
    trial.expect(sample.host_time <= trial.now() + trial.period, "host_time is ahead");
    trial.expect(sample.buttons >> descriptor.buttons.size() == 0,
                 "a button is pressed that the descriptor lacks");
    expect_edges(trial, before);
    before = sample;
  }
}

void stays_in_its_workspace_under_full_force(DriverTrial& trial) {
  if (!trial.start()) return;
  const driver::Descriptor descriptor = trial.driver->describe();
  const double margin_m = descriptor.position_resolution_m;
  const auto is_between = [&](double value, double low, double high) {
    return value >= low - margin_m && value <= high + margin_m;
  };
  const auto& [low, high] = descriptor.workspace;
  for (const double sign : {1.0, -1.0}) {
    for (int i = 0; i < 1000 && !trial.is_over(); ++i) {
      const double newton = sign * descriptor.limits.force_newton_max / 2;
      if (!trial.expect_ok(trial.exchange(CommandMode::kForce, {{newton, newton, newton}, {}}))) {
        return;
      }
      const Vector3& at = trial.sample.pose.position_m;
      trial.expect(is_between(at.x, low.x, high.x) && is_between(at.y, low.y, high.y) &&
                       is_between(at.z, low.z, high.z),
                   "it is at " + text_of(at) + " m, outside of its workspace");
    }
  }
}

void never_applies_more_than_its_limits(DriverTrial& trial) {
  if (!trial.start()) return;
  const driver::Limits limits = trial.driver->describe().limits;
  const std::array<double, 9> values{0, 1, -3, 50, -1e9, 1e308, kNan, kInfinity, -kInfinity};
  for (const double x : values) {
    for (const double y : values) {
      for (const double z : values) {
        if (trial.is_over()) return;
        static_cast<void>(trial.exchange(CommandMode::kForce, {{x, y, z}, {z, x, y}}));
        const driver::Wrench& applied = trial.sample.wrench_applied;
        const std::string told = " when told " + text_of({x, y, z}) + " N";
        trial.expect(is_finite(applied.force_newton) &&
                         length(applied.force_newton) <= limits.force_newton_max * (1 + 1e-9),
                     "it applies " + text_of(applied.force_newton) + " N" + told);
        trial.expect(
            length(applied.torque_newton_metre) <= limits.torque_newton_metre_max * (1 + 1e-9),
            "it applies " + text_of(applied.torque_newton_metre) + " N m" + told);
        trial.expect(is_finite(trial.sample.pose.position_m), "its position is not finite" + told);
      }
    }
  }
}

void applies_nothing_in_mode_off_and_in_unknown_modes(DriverTrial& trial) {
  if (!trial.start()) return;
  const double newton = trial.driver->describe().limits.force_newton_max / 2;
  for (const CommandMode mode : {CommandMode::kOff, static_cast<CommandMode>(200)}) {
    if (!trial.expect_ok(trial.exchange(CommandMode::kForce, {{newton, 0, 0}, {}}))) return;
    trial.expect(
        std::abs(trial.sample.wrench_applied.force_newton.x - newton) <= 1e-3 * newton + 1e-12,
        "it does not apply a force of half its limit along x");
    if (!trial.expect_ok(trial.exchange(mode, {{newton, 0, 0}, {}}))) return;
    trial.expect(trial.sample.wrench_applied == driver::Wrench{},
                 "it applies a force in mode " + std::to_string(static_cast<int>(mode)));
  }
}

void is_gone_outside_of_active(DriverTrial& trial) {
  trial.sample.pose.position_m.x = 0.0125;
  trial.expect(trial.exchange(CommandMode::kOff) == ExchangeStatus::kGone,
               "exchange() before activate() is not kGone");
  trial.expect(trial.sample.pose.position_m.x == 0.0125,
               "exchange() that is kGone changes the sample");
  if (!trial.start()) return;
  trial.expect_ok(trial.exchange(CommandMode::kOff));
  trial.driver->deactivate();
  trial.expect(trial.exchange(CommandMode::kOff) == ExchangeStatus::kGone,
               "exchange() after deactivate() is not kGone");
}

void starts_again_after_its_end(DriverTrial& trial) {
  for (int round = 0; round < 3; ++round) {
    if (!trial.start()) return;
    for (int i = 0; i < 20; ++i) {
      if (!trial.expect_ok(trial.exchange(CommandMode::kOff))) return;
    }
    trial.driver->deactivate();
    trial.driver->deactivate();
  }
  // A driver may be destroyed while it is active.
  trial.start();
}

void survives_pauses_and_repeated_times(DriverTrial& trial) {
  if (!trial.start()) return;
  for (const Duration pause : {Duration{0}, Duration{1}, Duration{std::chrono::milliseconds{50}},
                               Duration{std::chrono::hours{1}}}) {
    trial.pass(pause - trial.period);
    static_cast<void>(trial.exchange(CommandMode::kForce, {{1, 0, 0}, {}}));
    trial.expect(
        is_finite(trial.sample.pose.position_m) && is_finite(trial.sample.twist.linear_m_per_s),
        "a pause makes position or velocity not finite");
  }
}

constexpr std::array kChecks{
    DriverCheck{"DescribesItselfWhole", &describes_itself_whole},
    DriverCheck{"DescribesEachParameter", &describes_each_parameter},
    DriverCheck{"RefusesAPeriodOfNothingInWords", &refuses_a_period_of_nothing_in_words},
    DriverCheck{"DescribesItselfTheSameInEveryState", &describes_itself_the_same_in_every_state},
    DriverCheck{"IsGoneOutsideOfActiveAndLeavesTheSample", &is_gone_outside_of_active},
    DriverCheck{"GivesFiniteSamplesWithTimesThatGrow", &gives_finite_samples_with_times_that_grow},
    DriverCheck{"AppliesNothingInModeOffAndInModesItDoesNotKnow",
                &applies_nothing_in_mode_off_and_in_unknown_modes},
    DriverCheck{"NeverAppliesMoreThanItsLimitsWhateverItIsTold",
                &never_applies_more_than_its_limits},
    DriverCheck{"KeepsJointsAndOutputsWithinItsDescriptor",
                &keeps_joints_and_outputs_within_its_descriptor},
    DriverCheck{"StaysInItsWorkspaceUnderFullForce", &stays_in_its_workspace_under_full_force},
    DriverCheck{"StartsAgainAfterItsEnd", &starts_again_after_its_end},
    DriverCheck{"SurvivesPausesAndRepeatedTimes", &survives_pauses_and_repeated_times},
    DriverCheck{"TakesParametersInEveryState", &takes_parameters_in_every_state},
    DriverCheck{"CalibrationsEndWithValuesOrWords", &calibrations_end_with_values_or_words},
    DriverCheck{"CalibrationsOutliveTheirDriver", &calibrations_outlive_their_driver},
};

}  // namespace

std::span<const DriverCheck> driver_checks() {
  return kChecks;
}

std::vector<std::string> run_check(const DriverCheck& check, DriverMaker& maker, Duration period,
                                   CheckPace pace) {
  DriverTrial trial(maker, period, pace);
  if (trial.driver != nullptr) check.run(trial);
  return trial.take_faults();
}

bool DriverTrial::renew() {
  driver.reset();
  auto made = maker_.make();
  if (!made) return expect(false, made.error().text());
  driver = std::move(*made);
  return true;
}

bool DriverTrial::start() {
  const auto configured = driver->configure({.period = period});
  if (!configured) return expect(false, "configure() failed: " + configured.error().text());
  const auto activated = driver->activate();
  if (!activated) return expect(false, "activate() failed: " + activated.error().text());
  return true;
}

ExchangeStatus DriverTrial::exchange(const driver::Setpoint& setpoint) {
  now_ += period;
  if (pace_ == CheckPace::kReal) {
    // The driver sees the check's pause as real time, but the check does not wait for hours.
    if (now_ - rt::now() < std::chrono::seconds{1}) rt::sleep_until(now_);
    now_ = std::max(now_, rt::now());
  }
  driver::Command command;
  static_cast<driver::Setpoint&>(command) = setpoint;
  command.sequence = ++sequence_;
  command.cycle_time = now_;
  command.deadline = now_ + 30 * period;
  sample.faults = {};
  return driver->exchange(command, sample);
}

ExchangeStatus DriverTrial::exchange(CommandMode mode, const driver::Wrench& wrench) {
  driver::Setpoint setpoint;
  setpoint.mode = mode;
  setpoint.wrench = wrench;
  return exchange(setpoint);
}

bool DriverTrial::expect(bool holds, const std::string& fault) {
  const bool is_new = std::ranges::count(faults_, fault) == 0;
  if (!holds && is_new && !is_over()) faults_.push_back(fault);
  return holds;
}

bool DriverTrial::expect_ok(ExchangeStatus status) {
  return expect(status == ExchangeStatus::kOk,
                "exchange() returned '" + std::string(to_string(status)) + "'");
}

}  // namespace rtpm::driver_host
