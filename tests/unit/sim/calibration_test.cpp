#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include "dialogue.hpp"
#include "rtpm/device_sim/gaze_driver.hpp"
#include "rtpm/device_sim/sim_driver.hpp"

/// The calibrations of arm and gaze tracker, through the driver interface.
namespace rtpm::device_sim {
namespace {

using driver::ParameterSetting;
using test::Cycles;

constexpr double kErrorMetres = 2e-3;

std::unique_ptr<SimDriver> make_arm(SimConfig config = {.is_held = false,
                                                        .encoder_error_m = kErrorMetres}) {
  auto arm = SimDriver::create(std::move(config));
  EXPECT_TRUE(arm) << arm.error().text();
  return std::move(*arm);
}

driver::Setpoint force(double x, double y, double z) {
  driver::Setpoint setpoint;
  setpoint.mode = driver::CommandMode::kForce;
  setpoint.wrench.force_newton = {x, y, z};
  return setpoint;
}

double distance_m(const driver::Sample& sample) {
  const driver::Vector3& at = sample.pose.position_m;
  return std::hypot(at.x, at.y, at.z);
}

TEST(ArmCalibration, FindsTheEncodersOffset) {
  auto arm = make_arm();
  Cycles cycles(*arm);
  EXPECT_GT(distance_m(cycles.run(1)), 1e-4) << "at home it reads wrong";
  const auto end = cycles.calibrate("encoder_offset");
  EXPECT_EQ(end.prompt_count, 1);
  auto found = test::result_of(end);
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0].name, "encoder.offset_m");
  EXPECT_GT(distance_m(cycles.run(1)), 1e-4) << "not before it is kept";
  ASSERT_TRUE(arm->set_parameters(found));
  EXPECT_LT(distance_m(cycles.run(1)), ArmConfig{}.resolution_m);
  EXPECT_LT(std::abs(cycles.run(1).twist.linear_m_per_s.x), 1e-6) << "a correction is no motion";
  auto again = test::result_of(cycles.calibrate("encoder_offset"));
  const auto& first = std::get<std::vector<double>>(found[0].value);
  const auto& second = std::get<std::vector<double>>(again[0].value);
  for (std::size_t i = 0; i < 3; ++i)
    EXPECT_NEAR(first[i], second[i], 1e-9);
}

TEST(ArmCalibration, DrawsTheErrorFromTheSeed) {
  auto one = make_arm({.is_held = false, .seed = 1, .encoder_error_m = kErrorMetres});
  auto same = make_arm({.is_held = false, .seed = 1, .encoder_error_m = kErrorMetres});
  auto other = make_arm({.is_held = false, .seed = 2, .encoder_error_m = kErrorMetres});
  const auto read = [](SimDriver& arm) { return Cycles(arm).run(1).pose.position_m; };
  EXPECT_EQ(read(*one), read(*same));
  EXPECT_NE(read(*one), read(*other));
  EXPECT_FALSE(SimDriver::create({.encoder_error_m = -1}));
}

TEST(ArmCalibration, FailsIfTheArmMoves) {
  auto held = make_arm({.encoder_error_m = kErrorMetres});
  test::expect_failure(Cycles(*held).calibrate("encoder_offset"), "the arm moved by");
}

TEST(ArmCalibration, FailsAwayFromTheHomePosition) {
  auto arm = make_arm();
  Cycles cycles(*arm);
  cycles.run(1000, force(5, 0, 0));
  cycles.run(1000);
  test::expect_failure(cycles.calibrate("encoder_offset"), "too far from its home position");
}

TEST(ArmCalibration, ChangesNothingIfAbandoned) {
  auto arm = make_arm();
  Cycles cycles(*arm);
  const driver::Vector3 before = cycles.run(1).pose.position_m;
  cycles.calibrate("encoder_offset", {}, 1);
  cycles.calibrate("workspace", {}, 1);
  EXPECT_EQ(cycles.run(1).pose.position_m, before);
  EXPECT_EQ(arm->make_calibration("other"), nullptr);
}

TEST(ArmCalibration, FindsTheWorkspaceFromATour) {
  auto arm = make_arm({.is_held = false});
  Cycles cycles(*arm);
  const auto tour = [&](int) {
    cycles.move(1000, force(3, 3, 3));
    cycles.move(1000, force(-3, -3, -3));
    cycles.move(1000, {});
  };
  auto found = test::result_of(cycles.calibrate("workspace", tour));
  ASSERT_EQ(found.size(), 2U);
  EXPECT_EQ(found[0].name, "workspace.low_m");
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_NEAR(std::get<std::vector<double>>(found[0].value)[i], -0.1, 1e-4);
    EXPECT_NEAR(std::get<std::vector<double>>(found[1].value)[i], 0.1, 1e-4);
  }
  ASSERT_TRUE(arm->set_parameters(found));
  test::expect_failure(cycles.calibrate("workspace"), "move it through all corners");
}

TEST(ArmParameters, SetTheWorkspaceBeyondWhichASampleHasAFault) {
  auto arm = make_arm({.is_held = false});
  Cycles cycles(*arm);
  std::vector<ParameterSetting> low{{"workspace.low_m", std::vector<double>{0.01, -0.1, -0.1}}};
  EXPECT_FALSE(cycles.run(1).faults.has(driver::Fault::kOutsideWorkspace));
  ASSERT_TRUE(arm->set_parameters(low));
  EXPECT_TRUE(cycles.run(1).faults.has(driver::Fault::kOutsideWorkspace));
  std::vector<ParameterSetting> crossed{{"encoder.offset_m", std::vector<double>{0.01, 0, 0}},
                                        {"workspace.high_m", std::vector<double>{0, 0.1, 0.1}}};
  const auto refused = arm->set_parameters(crossed);
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().text().find("workspace.low_m is above"), std::string::npos);
  EXPECT_EQ(cycles.run(1).pose.position_m, driver::Vector3{}) << "nothing has changed";
}

TEST(ArmParameters, PersistOverDeactivation) {
  auto arm = make_arm({.is_held = false});
  std::vector<ParameterSetting> offset{{"encoder.offset_m", std::vector<double>{0.01, 0, 0}}};
  ASSERT_TRUE(arm->set_parameters(offset)) << "before it is configured";
  EXPECT_DOUBLE_EQ(Cycles(*arm).run(1).pose.position_m.x, -0.01);
  arm->deactivate();
  EXPECT_DOUBLE_EQ(Cycles(*arm).run(1).pose.position_m.x, -0.01);
}

TEST(ArmParameters, SetTheCyclesOfTheVelocityMean) {
  const auto velocity_after = [](std::int64_t cycle_count) {
    auto arm = make_arm({.is_held = false});
    std::vector<ParameterSetting> window{{"velocity.cycle_count", cycle_count}};
    EXPECT_TRUE(arm->set_parameters(window));
    Cycles cycles(*arm);
    return cycles.run(20, force(5, 0, 0)).twist.linear_m_per_s.x;
  };
  EXPECT_GT(velocity_after(1), velocity_after(8)) << "it accelerates: the shorter, the newer";
}

/// The root mean square of a tracker's error over the nine points.
double error_rad(GazeDriver& tracker, Cycles& cycles) {
  double sum = 0;
  for (int i = 0; i < GazeDriver::kPointCount; ++i) {
    tracker.look_at(i);
    const Gaze gaze = gaze_of(cycles.run(1).pose.orientation);
    const Gaze point = GazeDriver::point(i);
    sum += std::pow(gaze.right_rad - point.right_rad, 2) + std::pow(gaze.up_rad - point.up_rad, 2);
  }
  tracker.look_at(-1);
  return std::sqrt(sum / GazeDriver::kPointCount);
}

TEST(GazeCalibration, CorrectsTheOpticsByNinePoints) {
  GazeDriver tracker({});
  Cycles cycles(tracker);
  const double before_rad = error_rad(tracker, cycles);
  EXPECT_GT(before_rad, 0.03);
  const auto end = cycles.calibrate("nine_points");
  EXPECT_EQ(end.prompt_count, GazeDriver::kPointCount);
  auto found = test::result_of(end);
  ASSERT_EQ(found.size(), 2U);
  EXPECT_NE(std::get<driver::CalibrationDone>(end.state).summary.find("mrad"), std::string::npos);
  EXPECT_GT(error_rad(tracker, cycles), 0.03) << "not before it is kept";
  ASSERT_TRUE(tracker.set_parameters(found));
  EXPECT_LT(error_rad(tracker, cycles), before_rad / 30);
  EXPECT_NEAR(tracker.correction().gain.right_rad, 1 / GazeDriver::kOpticsGain.right_rad, 2e-3);
  // A second calibration of the corrected tracker gives the same result.
  auto again = test::result_of(cycles.calibrate("nine_points"));
  ASSERT_TRUE(tracker.set_parameters(again));
  EXPECT_LT(error_rad(tracker, cycles), before_rad / 30);
}

TEST(GazeCalibration, ChangesNothingIfAbandoned) {
  GazeDriver tracker({});
  Cycles cycles(tracker);
  cycles.calibrate("nine_points", {}, 5);
  EXPECT_EQ(tracker.correction().gain.right_rad, 1);
  EXPECT_EQ(tracker.correction().offset.right_rad, 0);
  std::vector<double> seen;
  for (int i = 0; i < 8; ++i)
    seen.push_back(gaze_of(cycles.run(500).pose.orientation).right_rad);
  EXPECT_GT(*std::ranges::max_element(seen) - *std::ranges::min_element(seen), 0.1)
      << "the person looks at will again";
}

TEST(GazeCalibration, FailsIfThePersonLooksElsewhere) {
  GazeDriver tracker({});
  Cycles cycles(tracker);
  test::expect_failure(cycles.calibrate("nine_points", [&](int) { tracker.look_at(4); }),
                       "does not suit the nine points");
}

TEST(GazeCalibration, FailsIfTheGazeMovesAtAPoint) {
  GazeDriver tracker({});
  Cycles cycles(tracker);
  const auto calibration = tracker.make_calibration("nine_points");
  static_cast<void>(calibration->step(cycles.run(1), std::nullopt));
  Cycles::End end{calibration->step(cycles.run(1), "ready"), 1};
  for (int i = 0; i < 10; ++i)
    end.state = calibration->step(cycles.run(1), std::nullopt);
  ASSERT_TRUE(std::holds_alternative<driver::CalibrationRunning>(end.state));
  tracker.look_at(8);
  end.state = calibration->step(cycles.run(1), std::nullopt);
  test::expect_failure(end, "the gaze moved by");
  EXPECT_EQ(tracker.correction().gain.right_rad, 1);
}

}  // namespace
}  // namespace rtpm::device_sim
