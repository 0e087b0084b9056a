#include "wall.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "configuration.hpp"
#include "rtpm/models/evaluator.hpp"

namespace rtpm::servo {
namespace {

using std::chrono::milliseconds;

driver::Sample sample_at(double z_m, double velocity_m_per_s) {
  driver::Sample sample;
  sample.pose.position_m = {0.01, -0.02, z_m};
  sample.twist.linear_m_per_s = {0, 0, velocity_m_per_s};
  return sample;
}

driver::Descriptor arm() {
  driver::Descriptor descriptor;
  descriptor.device_class = driver::DeviceClass::kHaptic;
  descriptor.axes = {{"x", true, true}, {"y", true, true}, {"z", true, true}};
  descriptor.modes = {driver::CommandMode::kForce};
  descriptor.limits = {9, 0, 1667, 2.5};
  return descriptor;
}

TEST(StiffnessBound, FollowsItsFormula) {
  // (2.5 − 0.5) / (0.5 ms + 2 ms)
  EXPECT_NEAR(stiffness_bound(2.5, 0.5, milliseconds{1}, milliseconds{1}), 800, 1e-9);
  EXPECT_NEAR(stiffness_bound(2.5, 0.5, milliseconds{10}, milliseconds{1}), 2.0 / 0.007, 1e-9);
  EXPECT_EQ(stiffness_bound(2.5, 3, milliseconds{1}, milliseconds{1}), 0);
}

/// Presses a mass against the wall with 1 N, over a loop with the delays that stiffness_bound()
/// counts; returns the fastest motion in the fourth second, in m/s; zero if the mass rests.
double buzz(const Wall& wall, double device_damping) {
  constexpr double kMassKg = 0.15;
  constexpr double kSliceSeconds = 0.00002;
  constexpr int kSliceCount = 50;
  double z_m = 0.002;
  double velocity = -0.05;
  double fastest = 0;
  driver::Sample measured = sample_at(z_m, velocity);
  driver::Vector3 waiting{};
  scene::GodObject proxy = wall.proxy();
  for (int cycle = 0; cycle < 4000; ++cycle) {
    // The device applies the last cycle's force and measures; the loop gets the previous sample.
    const double applied_newton = waiting.z;
    waiting = proxy.touch(measured).force_newton;
    measured = sample_at(z_m, velocity);
    for (int slice = 0; slice < kSliceCount; ++slice) {
      velocity += (applied_newton - 1.0 - device_damping * velocity) / kMassKg * kSliceSeconds;
      z_m += velocity * kSliceSeconds;
    }
    if (cycle >= 3000) fastest = std::max(fastest, std::abs(velocity));
  }
  return fastest;
}

TEST(StiffnessBound, SeparatesPassiveWallsFromUnstableOnes) {
  const double bound = stiffness_bound(2.5, 0, milliseconds{1}, milliseconds{1});
  EXPECT_LT(buzz({.stiffness_newton_per_m = 0.75 * bound}, 2.5), 0.001);
  EXPECT_GT(buzz({.stiffness_newton_per_m = 1.5 * bound}, 2.5), 0.05)
      << "above it, the wall feeds energy back for ever";
}

TEST(ChooseWall, TakesThreeQuartersOfTheBound) {
  Configuration configuration;
  const auto wall = choose_wall(configuration, arm());
  ASSERT_TRUE(wall) << wall.error().text();
  EXPECT_NEAR(wall->stiffness_newton_per_m, 600, 1e-9);
  configuration.rate_hz = 100;
  EXPECT_LT(choose_wall(configuration, arm())->stiffness_newton_per_m, 300)
      << "a slower loop renders a softer wall";
}

TEST(ChooseWall, NeverExceedsTheDevicesLimit) {
  driver::Descriptor soft = arm();
  soft.limits.stiffness_newton_per_m_max = 100;
  EXPECT_NEAR(choose_wall({}, soft)->stiffness_newton_per_m, 75, 1e-9);
}

TEST(ChooseWall, RefusesAWallThatWouldBuzzAndNamesTheBound) {
  Configuration configuration;
  configuration.wall.stiffness_newton_per_m = 5000;
  const auto wall = choose_wall(configuration, arm());
  ASSERT_FALSE(wall);
  EXPECT_EQ(wall.error().text(),
            "a wall of --stiffness 5000 N/m would buzz: at this rate up to 800 N/m is passive. "
            "Remedy: lower it, raise --rate, or give --render local.");
  configuration.wall = {.stiffness_newton_per_m = 100, .damping_newton_s_per_m = 3};
  const auto damped = choose_wall(configuration, arm());
  ASSERT_FALSE(damped);
  EXPECT_NE(damped.error().text().find("--damping 3 "), std::string::npos) << damped.error().text();
}

TEST(ChooseWall, HasTheSameBoundForEachScene) {
  for (const scene::Shape shape :
       {scene::Shape::kPlane, scene::Shape::kSphere, scene::Shape::kTexture}) {
    Configuration configuration;
    configuration.scene = to_string(shape);
    const auto wall = choose_wall(configuration, arm());
    ASSERT_TRUE(wall) << wall.error().text();
    EXPECT_EQ(wall->shape, shape);
    EXPECT_NEAR(wall->stiffness_newton_per_m, 600, 1e-9);
    configuration.wall.stiffness_newton_per_m = 801;
    EXPECT_FALSE(choose_wall(configuration, arm()));
  }
}

TEST(ChooseWall, RefusesASolidWithTooFewAxes) {
  driver::Descriptor flat = arm();
  flat.axes[0].is_actuated = false;
  Configuration configuration;
  EXPECT_TRUE(choose_wall(configuration, flat)) << "a plane needs z only";
  configuration.scene = "sphere";
  const auto wall = choose_wall(configuration, flat);
  ASSERT_FALSE(wall);
  EXPECT_EQ(wall.error().text(),
            "lab/arm0 is a haptic device without force along x. Remedy: choose a haptic device "
            "with --device.");
}

TEST(ChooseWall, RefusesALocalBall) {
  Configuration configuration;
  configuration.render = "local";
  configuration.scene = "sphere";
  const auto wall = choose_wall(configuration, arm());
  ASSERT_FALSE(wall);
  EXPECT_EQ(wall.error().text(),
            "--render local has no sphere. Remedy: give --scene plane, or --render remote.");
}

TEST(ChooseWall, LetsALocalWallBeStiffer) {
  Configuration configuration;
  configuration.render = "local";
  // (2.5 − 0.5) / 1.5 ms
  EXPECT_NEAR(choose_wall(configuration, arm())->stiffness_newton_per_m, 0.75 * 1333, 1);
  configuration.wall.stiffness_newton_per_m = 1500;
  const auto wall = choose_wall(configuration, arm());
  ASSERT_FALSE(wall);
  EXPECT_NE(wall.error().text().find("up to 1333 N/m"), std::string::npos) << wall.error().text();
}

TEST(WallAsPlane, IsTheSameWall) {
  const Wall wall{.face_m = 0.005, .stiffness_newton_per_m = 500, .damping_newton_s_per_m = 2};
  gvd::Evaluator device;
  device.set(gvd::ModelList{std::vector<gvd::Model>{wall.as_plane()}});
  for (const double z_m : {0.006, 0.0049, 0.003, -0.02}) {
    for (const double velocity : {-0.3, 0.0, 0.3, 10.0}) {
      const driver::Sample sample = sample_at(z_m, velocity);
      // The proxy rests a little above the face.
      EXPECT_NEAR(device.evaluate(sample).wrench.force_newton.z,
                  wall.proxy().touch(sample).force_newton.z,
                  wall.stiffness_newton_per_m * 3 * scene::GodObject::kSkinMetre);
    }
  }
}

TEST(ChooseWall, RefusesADeviceWithoutForce) {
  driver::Descriptor tracker;
  tracker.device_class = driver::DeviceClass::kTracker;
  const auto wall = choose_wall({}, tracker);
  ASSERT_FALSE(wall);
  EXPECT_EQ(wall.error().text(),
            "lab/arm0 is a tracker device without force along z. Remedy: choose a haptic "
            "device with --device.");
}

}  // namespace
}  // namespace rtpm::servo
