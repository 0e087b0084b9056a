#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "rtpm/device_sim/biometric_driver.hpp"
#include "rtpm/device_sim/gaze_driver.hpp"
#include "rtpm/device_sim/knob_driver.hpp"
#include "rtpm/device_sim/player_driver.hpp"
#include "rtpm/device_sim/stimulus_driver.hpp"

/// The simulated devices other than the arm, on a simulated time line.
namespace rtpm::device_sim {
namespace {

using driver::CommandMode;
using std::chrono::milliseconds;

/// Runs a twin in cycles of a millisecond; each run() repeats one command.
template <class Driver>
class Played {
 public:
  template <class... Config>
  explicit Played(TwinConfig config = {}, Config... more) : driver(std::move(config), more...) {
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
  Played<KnobDriver> free({}, KnobConfig{.hand_newton_metre = 0});
  free.run(100, effort(0.01));
  // 0.01 N m on 1e-4 kg m² against 5e-4 N m s/rad: v = (T/b) (1 - exp(-b t / J)).
  EXPECT_NEAR(free.sample.joint_velocities[0], 20 * (1 - std::exp(-0.5)), 0.05);
  EXPECT_GT(free.sample.joints[0], 0.3);
  EXPECT_EQ(free.sample.efforts_applied[0], 0.01);
}

TEST(KnobDriver, SaturatesAndReportsIt) {
  Played<KnobDriver> knob;
  knob.run(1, effort(3));
  EXPECT_EQ(knob.sample.efforts_applied[0], KnobConfig{}.effort_newton_metre_max);
  EXPECT_TRUE(knob.sample.faults.has(driver::Fault::kDeviceSaturated));
  knob.run(1);
  EXPECT_EQ(knob.sample.efforts_applied[0], 0) << "off";
}

TEST(KnobDriver, IsTurnedAndPushed) {
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

TEST(StimulusDriver, SensesEachStimulusAfterItsDelay) {
  Played<StimulusDriver> board;
  board.run(12, driver::Setpoint::with_outputs({1, 1, 1}));
  EXPECT_EQ(board.sample.outputs_applied[0], 1);
  EXPECT_EQ(board.sample.analogs[0], 0) << "the flash takes 12 ms";
  EXPECT_EQ(board.sample.analogs[1], 1);
  EXPECT_EQ(board.sample.button_edges[0], 1);
  board.run(1, driver::Setpoint::with_outputs({1, 1, 1}));
  EXPECT_EQ(board.sample.analogs[0], 1);
  board.run(20);
  EXPECT_EQ(board.sample.analogs[0], 0) << "all is off without a command";
  EXPECT_EQ(board.sample.button_edges[0], 2);
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

TEST(GazeDriver, MovesTheGazeAndBlinks) {
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
