#include "rtpm/device_sim/arm.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <sstream>

namespace rtpm::device_sim {
namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;
using std::chrono::seconds;

const Eigen::Vector3d no_force = Eigen::Vector3d::Zero();

Hand hand_at(double x_m, double y_m, double z_m, const HandConfig& config = {}) {
  std::ostringstream text;
  text << "0," << x_m << ',' << y_m << ',' << z_m << '\n';
  std::istringstream stream(text.str());
  return {config, std::move(*Trajectory::parse(stream, "hand.csv", {{-1, -1, -1}, {1, 1, 1}}))};
}

double kinetic_joule(const Arm& arm) {
  return 0.5 * arm.config().mass_kg * arm.motion().velocity_m_per_s.squaredNorm();
}

TEST(Arm, ObeysNewtonsSecondLaw) {
  ArmConfig config;
  config.damping_newton_s_per_m = 0.1;
  Arm arm{config};
  for (int ms = 0; ms < 50; ++ms)
    arm.step({0.3, 0, 0}, milliseconds{1});
  // There is hardly any damping, so v = F t / m and x = F t² / 2 m.
  EXPECT_NEAR(arm.motion().velocity_m_per_s.x(), 0.3 * 0.05 / config.mass_kg, 0.005);
  EXPECT_NEAR(arm.motion().position_m.x(), 0.3 * 0.05 * 0.05 / 2 / config.mass_kg, 0.0002);
  EXPECT_NEAR(arm.time_s(), 0.05, 1e-12);
}

TEST(Arm, ReachesTheSpeedWhereDampingEqualsForce) {
  ArmConfig config;
  config.workspace = {{-10, -10, -10}, {10, 10, 10}};
  Arm arm{config};
  for (int ms = 0; ms < 1000; ++ms)
    arm.step({0, 1, 0}, milliseconds{1});
  EXPECT_NEAR(arm.motion().velocity_m_per_s.y(), 1 / config.damping_newton_s_per_m, 1e-4);
}

TEST(Arm, NeverGainsEnergyByItself) {
  Arm arm{ArmConfig{}};
  for (int ms = 0; ms < 20; ++ms)
    arm.step({5, -3, 2}, milliseconds{1});
  double last_joule = kinetic_joule(arm);
  EXPECT_GT(last_joule, 0.01);
  for (const Duration step : {Duration{microseconds{100}}, Duration{milliseconds{1}},
                              Duration{milliseconds{7}}, Duration{milliseconds{20}}}) {
    arm.step(no_force, step);
    EXPECT_LE(kinetic_joule(arm), last_joule);
    last_joule = kinetic_joule(arm);
  }
}

TEST(Arm, NeverGainsEnergyInAStiffHandAtAnyStep) {
  for (const double stiffness : {10.0, 300.0, 1e5}) {
    HandConfig held;
    held.stiffness_newton_per_m = stiffness;
    held.force_newton_max = 1e9;
    for (const Duration step :
         {Duration{microseconds{10}}, Duration{milliseconds{1}}, Duration{milliseconds{20}}}) {
      Arm arm{ArmConfig{}, hand_at(0, 0, 0, held)};
      arm.step({9, 0, 0}, milliseconds{20});
      const auto energy = [&] {
        return kinetic_joule(arm) + 0.5 * stiffness * arm.motion().position_m.squaredNorm();
      };
      const double begin_joule = energy();
      for (int i = 0; i < 500; ++i) {
        arm.step(no_force, step);
        ASSERT_LE(energy(), begin_joule * (1 + 1e-9)) << stiffness << " N/m, step " << i;
      }
    }
  }
}

TEST(Arm, IsPulledToTheHand) {
  Arm arm{ArmConfig{}, hand_at(0.01, -0.02, 0.03)};
  EXPECT_TRUE(arm.motion().position_m.isApprox(Eigen::Vector3d(0.01, -0.02, 0.03)))
      << "it begins where the hand is";
  for (int ms = 0; ms < 2000; ++ms)
    arm.step({1.5, 0, 0}, milliseconds{1});
  // Motor and hand are in balance: 1.5 N over 300 N/m.
  EXPECT_NEAR(arm.motion().position_m.x(), 0.01 + 1.5 / 300, 1e-5);
  EXPECT_NEAR(arm.hand_newton().x(), -1.5, 1e-3);
}

TEST(Arm, LimitsTheForceOfTheHand) {
  HandConfig weak;
  weak.force_newton_max = 2;
  Arm arm{ArmConfig{}, hand_at(0.09, 0, 0, weak)};
  for (int ms = 0; ms < 500; ++ms) {
    arm.step({-5, 0, 0}, milliseconds{1});
    EXPECT_LE(arm.hand_newton().norm(), 2 + 1e-9);
  }
  EXPECT_LT(arm.motion().position_m.x(), 0) << "the motors win";
}

TEST(Arm, SaturatesInTheDirectionOfItsCommand) {
  Arm arm{ArmConfig{}};
  arm.step({3, 4, 0}, milliseconds{1});
  EXPECT_FALSE(arm.is_saturated());
  EXPECT_EQ(arm.applied_newton(), Eigen::Vector3d(3, 4, 0));
  for (const double scale : {30.0, 1e6, 1e150, 1e308}) {
    const Eigen::Vector3d force = scale * Eigen::Vector3d(0.6, -0.64, 0.48);
    arm.step(force, milliseconds{1});
    EXPECT_TRUE(arm.is_saturated());
    EXPECT_NEAR(arm.applied_newton().norm(), 9, 1e-9);
    EXPECT_TRUE(
        arm.applied_newton().normalized().isApprox(Eigen::Vector3d(0.6, -0.64, 0.48), 1e-9));
  }
}

TEST(Arm, TreatsACommandThatIsNotFiniteAsZero) {
  Arm arm{ArmConfig{}};
  for (const double bad : {std::nan(""), HUGE_VAL, -HUGE_VAL}) {
    arm.step({0, bad, 0}, milliseconds{1});
    EXPECT_EQ(arm.applied_newton(), no_force);
    EXPECT_TRUE(arm.is_saturated());
    EXPECT_TRUE(arm.motion().position_m.allFinite());
  }
}

TEST(Arm, HaltsAtItsStops) {
  Arm arm{ArmConfig{}};
  for (int ms = 0; ms < 1000; ++ms)
    arm.step({9, 9, -9}, milliseconds{1});
  EXPECT_TRUE(arm.is_at_stop());
  EXPECT_EQ(arm.motion().position_m, Eigen::Vector3d(0.1, 0.1, -0.1));
  arm.step(no_force, milliseconds{1});
  EXPECT_EQ(arm.motion().velocity_m_per_s, no_force) << "a stop does not throw it back";
}

TEST(Arm, BoundsTheTimeOfAStepAndNeverGoesBack) {
  Arm arm{ArmConfig{}};
  arm.step(no_force, seconds{60});
  EXPECT_DOUBLE_EQ(arm.time_s(), 0.020);
  arm.step(no_force, milliseconds{-5});
  EXPECT_DOUBLE_EQ(arm.time_s(), 0.020);
}

TEST(Arm, MeasuresInStepsOfItsEncoders) {
  ArmConfig config;
  config.resolution_m = 30e-6;
  Arm arm{config};
  for (int ms = 0; ms < 200; ++ms) {
    arm.step({0.05, 0.03, -0.01}, milliseconds{1});
    const Eigen::Vector3d steps = arm.measured_position_m() / config.resolution_m;
    EXPECT_LT((steps - steps.array().round().matrix()).norm(), 1e-6);
    EXPECT_LE((arm.measured_position_m() - arm.motion().position_m).cwiseAbs().maxCoeff(),
              config.resolution_m / 2 * (1 + 1e-9));
  }
}

TEST(VelocityEstimator, IsExactForSteadyMotionAndCalmForASingleStep) {
  VelocityEstimator steady;
  for (int i = 0; i < 50; ++i) {
    const double time_s = i * 0.001;
    const Eigen::Vector3d velocity = steady.update({0.1 * time_s, 0, -0.2 * time_s}, time_s);
    if (i > 0) {
      EXPECT_LT((velocity - Eigen::Vector3d(0.1, 0, -0.2)).norm(), 1e-9);
    }
  }
  VelocityEstimator still;
  double greatest = 0;
  for (int i = 0; i < 50; ++i) {
    const double x_m = i < 25 ? 0 : 30e-6;
    greatest = std::max(greatest, still.update({x_m, 0, 0}, i * 0.001).x());
  }
  EXPECT_NEAR(greatest, 30e-6 / 0.008, 1e-9) << "a plain difference would say 0.03 m/s";
}

TEST(VelocityEstimator, IgnoresATimeThatDoesNotGrow) {
  VelocityEstimator estimator;
  EXPECT_EQ(estimator.update({1, 0, 0}, 5), no_force);
  EXPECT_EQ(estimator.update({2, 0, 0}, 5), no_force);
  EXPECT_EQ(estimator.update({2, 0, 0}, 4), no_force);
  EXPECT_NEAR(estimator.update({2, 0, 0}, 6).x(), 1, 1e-12);
}

}  // namespace
}  // namespace rtpm::device_sim
