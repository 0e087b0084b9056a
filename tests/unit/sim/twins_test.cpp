#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "rtpm/device_sim/biometric_driver.hpp"
#include "rtpm/device_sim/gaze_driver.hpp"
#include "rtpm/device_sim/knob_driver.hpp"
#include "rtpm/device_sim/player_driver.hpp"

/// The simulated devices other than the arm, on a simulated time line.
namespace rtpm::device_sim {
namespace {

using driver::CommandMode;
using std::chrono::milliseconds;

/// Runs a twin in cycles of a millisecond; each run() repeats one command.
template <class Driver>
class Played {
 public:
  explicit Played(TwinConfig config = {}) : driver(std::move(config)) {
    EXPECT_TRUE(driver.configure({.period = milliseconds{1}}));
    EXPECT_TRUE(driver.activate());
  }
  void run(int cycle_count, const driver::Setpoint& setpoint = {}) {
    for (int i = 0; i < cycle_count; ++i) {
      static_cast<driver::Setpoint&>(command) = setpoint;
      command.cycle_time = now_ += milliseconds{1};
      sample.faults = {};
      ASSERT_EQ(driver.exchange(command, sample), driver::ExchangeStatus::kOk);
    }
  }

  Driver driver;
  driver::Command command{};
  driver::Sample sample{};

 private:
  MonotonicTime now_{std::chrono::seconds{100}};
};

driver::Setpoint effort(double newton_metre) {
  driver::Setpoint setpoint;
  setpoint.mode = CommandMode::kJointEffort;
  setpoint.joints[0] = newton_metre;
  return setpoint;
}

TEST(KnobDriver, GainsSpeedByItsInertia) {
  KnobDriver free({}, {.hand_newton_metre = 0});
  ASSERT_TRUE(free.configure({.period = milliseconds{1}}) && free.activate());
  driver::Sample sample;
  driver::Command command;
  static_cast<driver::Setpoint&>(command) = effort(0.01);
  for (int ms = 1; ms <= 100; ++ms) {
    command.cycle_time = MonotonicTime{milliseconds{ms}};
    ASSERT_EQ(free.exchange(command, sample), driver::ExchangeStatus::kOk);
  }
  // 0.01 N m on 1e-4 kg m² against 5e-4 N m s/rad: v = (T/b) (1 - exp(-b t / J)).
  EXPECT_NEAR(sample.joint_velocities[0], 20 * (1 - std::exp(-0.5)), 0.05);
  EXPECT_GT(sample.joints[0], 0.3);
  EXPECT_EQ(sample.efforts_applied[0], 0.01);
}

TEST(KnobDriver, SaturatesAndSaysSo) {
  Played<KnobDriver> knob;
  knob.run(1, effort(3));
  EXPECT_EQ(knob.sample.efforts_applied[0], KnobConfig{}.effort_newton_metre_max);
  EXPECT_TRUE(knob.sample.faults.has(driver::Fault::kDeviceSaturated));
  knob.run(1);
  EXPECT_EQ(knob.sample.efforts_applied[0], 0) << "off";
}

TEST(KnobDriver, IsTurnedAndPushedByFingers) {
  Played<KnobDriver> knob;
  double low = 0;
  double high = 0;
  for (int i = 0; i < 5950; ++i) {
    knob.run(1);
    low = std::min(low, knob.sample.joints[0]);
    high = std::max(high, knob.sample.joints[0]);
  }
  EXPECT_GT(high - low, 1) << "turned by more than a radian";
  EXPECT_EQ(knob.sample.button_edges[0], 3) << "pushed, released, pushed";
}

TEST(PlayerDriver, PlaysPausesSeeksAndStopsAtItsEnd) {
  Played<PlayerDriver> player;
  player.run(1500, driver::Setpoint::with_outputs({1, -1}));
  EXPECT_NEAR(player.sample.analogs[0], 1.5, 1e-3);
  player.run(500);
  EXPECT_NEAR(player.sample.analogs[0], 1.5, 1e-3) << "paused without a command";
  player.run(1000, driver::Setpoint::with_outputs({-0.5F, 30}));
  EXPECT_NEAR(player.sample.analogs[0], 29.5, 1e-3) << "it seeks once";
  player.run(1, driver::Setpoint::with_outputs({4, 59.999F}));
  player.run(100, driver::Setpoint::with_outputs({4, -1}));
  EXPECT_FLOAT_EQ(player.sample.analogs[0], PlayerDriver::kLengthSeconds);
  EXPECT_EQ(player.sample.analogs[1], 0) << "at the end it stands";
}

TEST(BiometricDriver, BeatsLikeAHeart) {
  Played<BiometricDriver> sensor;
  int beat_count = 0;
  bool was_high = false;
  for (int i = 0; i < 20'000; ++i) {
    sensor.run(1);
    const bool is_high = sensor.sample.analogs[0] > 0.7F;
    if (is_high && !was_high) ++beat_count;
    was_high = is_high;
    ASSERT_GT(sensor.sample.analogs[2], 1e-6F);
    ASSERT_LT(sensor.sample.analogs[2], 20e-6F);
  }
  EXPECT_EQ(beat_count, 22) << "20 s at 1.1 Hz";
}

TEST(BiometricDriver, GivesTheSameForTheSameSeed) {
  Played<BiometricDriver> first({.seed = 7});
  Played<BiometricDriver> second({.seed = 7});
  Played<BiometricDriver> other({.seed = 8});
  first.run(1500);
  second.run(1500);
  other.run(1500);
  EXPECT_EQ(first.sample.analogs, second.sample.analogs);
  EXPECT_NE(first.sample.analogs[2], other.sample.analogs[2]);
}

TEST(GazeDriver, MeasuresThroughItsOptics) {
  Played<GazeDriver> tracker;
  for (int i = 0; i < GazeDriver::kPointCount; ++i) {
    tracker.driver.look_at(i);
    tracker.run(1);
    const Gaze gaze = gaze_of(tracker.sample.pose.orientation);
    const Gaze point = GazeDriver::point(i);
    EXPECT_NEAR(gaze.right_rad, 0.03 + 1.1 * point.right_rad, 1e-3);
    EXPECT_NEAR(gaze.up_rad, -0.02 + 0.93 * point.up_rad, 1e-3);
  }
}

TEST(GazeDriver, ACorrectionTakesTheOpticsOut) {
  Played<GazeDriver> tracker;
  std::vector<driver::ParameterSetting> correction{
      {"correction.offset_rad", std::vector<double>{-0.03 / 1.1, 0.02 / 0.93}},
      {"correction.gain", std::vector<double>{1 / 1.1, 1 / 0.93}}};
  ASSERT_TRUE(tracker.driver.set_parameters(correction));
  tracker.driver.look_at(2);
  tracker.run(1);
  const Gaze gaze = gaze_of(tracker.sample.pose.orientation);
  EXPECT_NEAR(gaze.right_rad, GazeDriver::kPointDistanceRad, 1e-3);
  EXPECT_NEAR(gaze.up_rad, GazeDriver::kPointDistanceRad, 1e-3);
}

TEST(GazeDriver, LooksAroundAndBlinks) {
  Played<GazeDriver> tracker;
  std::vector<double> seen;
  for (int i = 0; i < 8; ++i) {
    tracker.run(500);
    seen.push_back(gaze_of(tracker.sample.pose.orientation).right_rad);
  }
  EXPECT_GT(*std::ranges::max_element(seen) - *std::ranges::min_element(seen), 0.1);
  EXPECT_GE(tracker.sample.button_edges[0], 1) << "a blink every 4 s";
}

}  // namespace
}  // namespace rtpm::device_sim
