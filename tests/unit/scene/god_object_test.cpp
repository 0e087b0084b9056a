#include "god_object.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "rtpm/driver/vector.hpp"

namespace rtpm::scene {
namespace {

using driver::Vector3;

constexpr double kStiffness = 600;
constexpr Material kSpring{.stiffness_newton_per_m = kStiffness};
constexpr double kHalfRidge = Scene::kRidgeMetre / 2;

driver::Sample sample_at(const Vector3& position_m, const Vector3& velocity = {}) {
  driver::Sample sample;
  sample.pose.position_m = position_m;
  sample.twist.linear_m_per_s = velocity;
  return sample;
}

/// The proxy is outside, and the force is that of a spring between device and proxy.
void expect_lawful(const GodObject& object, const Touch& touch) {
  ASSERT_TRUE(is_finite(touch.proxy_m) && is_finite(touch.force_newton));
  ASSERT_GE(object.scene().clearance_m(touch.proxy_m), 0) << "the proxy is in the solid";
  const Vector3 spring = scaled(difference(touch.proxy_m, touch.device_m), kStiffness);
  ASSERT_LE(length(difference(touch.force_newton, spring)), 1e-9 * (1 + length(spring)));
}

class AnyScene : public testing::TestWithParam<Shape> {
 protected:
  [[nodiscard]] Scene scene() const { return {.shape = GetParam(), .face_m = 0.004}; }
};

INSTANTIATE_TEST_SUITE_P(Of, AnyScene,
                         testing::Values(Shape::kPlane, Shape::kSphere, Shape::kTexture),
                         [](const auto& tested) { return std::string(to_string(tested.param)); });

TEST_P(AnyScene, IsNeverEnteredByTheProxyOnAnyPath) {
  for (unsigned seed = 1; seed <= 200; ++seed) {
    std::mt19937 random(seed);
    // Steps range from tremor to jumps through the whole scene.
    const double reach_m = std::pow(10.0, std::uniform_real_distribution(-5.0, -1.0)(random));
    std::normal_distribution<double> step(0, reach_m);
    GodObject object(scene(), kSpring);
    Vector3 at{0, 0, 0.02};
    for (int i = 0; i < 300; ++i) {
      at = sum(at, {step(random), step(random), step(random)});
      if (length(at) > 0.08) at = scaled(at, 0.08 / length(at));
      expect_lawful(object, object.touch(sample_at(at)));
      if (HasFatalFailure()) FAIL() << "seed " << seed << ", step " << i;
    }
  }
}

TEST_P(AnyScene, IsNotFeltFromOutside) {
  GodObject object(scene(), kSpring);
  for (int i = 0; i < 1000; ++i) {
    const Vector3 at{0.05 * std::sin(0.01 * i), 0.03 * std::cos(0.013 * i), 0.0042};
    const Touch touch = object.touch(sample_at(at));
    EXPECT_EQ(touch.proxy_m, at);
    EXPECT_EQ(touch.force_newton, Vector3{});
    EXPECT_EQ(touch.depth_m, 0);
  }
}

TEST_P(AnyScene, LetsGoOfADeviceThatComesOut) {
  GodObject object(scene(), kSpring);
  for (const double z_m : {0.01, -0.002, 0.003, 0.01}) {
    static_cast<void>(object.touch(sample_at({0.001, 0.002, z_m})));
  }
  const Touch out = object.touch(sample_at({0.001, 0.002, 0.01}));
  EXPECT_EQ(out.depth_m, 0);
  EXPECT_EQ(out.force_newton, Vector3{});
}

TEST_P(AnyScene, PutsTheProxyOfADeviceThatStartsInsideOnTheSurface) {
  GodObject object(scene(), kSpring);
  const Touch touch = object.touch(sample_at({0.002, 0.001, -0.003}));
  expect_lawful(object, touch);
  EXPECT_LE(scene().clearance_m(touch.proxy_m), 1e-6);
  EXPECT_GT(touch.force_newton.z, 0);
}

TEST_P(AnyScene, GivesFiniteForceForAnyInput) {
  const double kMax = std::numeric_limits<double>::max();
  const double kInfinity = std::numeric_limits<double>::infinity();
  const double kNan = std::numeric_limits<double>::quiet_NaN();
  const std::vector<double> numbers{0,    -0.0, 1e-310, 0.004,     -0.026,     -0.05, 99,
                                    -101, kMax, -kMax,  kInfinity, -kInfinity, kNan};
  for (const bool is_first : {true, false}) {
    for (const double x : numbers) {
      for (const double y : numbers) {
        for (const double z : numbers) {
          GodObject object(scene(),
                           {.stiffness_newton_per_m = kStiffness, .damping_newton_s_per_m = 0.5});
          if (!is_first) static_cast<void>(object.touch(sample_at({0, 0, 0.01})));
          const Touch touch = object.touch(sample_at({x, y, z}, {z, x, y}));
          ASSERT_TRUE(is_finite(touch.proxy_m)) << x << ' ' << y << ' ' << z;
          ASSERT_FALSE(std::isnan(length(touch.force_newton))) << x << ' ' << y << ' ' << z;
          ASSERT_GE(scene().clearance_m(touch.proxy_m), 0) << x << ' ' << y << ' ' << z;
          const Touch later = object.touch(sample_at({0, 0, 0.01}));
          ASSERT_TRUE(is_finite(later.force_newton)) << "it recovers";
        }
      }
    }
  }
}

TEST_P(AnyScene, NeverPullsAndOpposesMotionIntoIt) {
  const auto force_at = [&](double velocity_m_per_s) {
    GodObject object(scene(), {.stiffness_newton_per_m = 500, .damping_newton_s_per_m = 2});
    static_cast<void>(object.touch(sample_at({0, 0, 0.01})));
    return object.touch(sample_at({0, 0, 0.002}, {0, 0, velocity_m_per_s})).force_newton;
  };
  EXPECT_NEAR(force_at(0).z, 1.0, 1e-3);
  EXPECT_NEAR(force_at(-0.1).z, 1.2, 1e-3);
  EXPECT_NEAR(force_at(0.1).z, 0.8, 1e-3);
  EXPECT_EQ(force_at(10), Vector3{}) << "it never pulls";
}

TEST(Clearance, IsNeverMoreThanTheDistanceAndChangesNoFaster) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> coordinate(-0.06, 0.06);
  for (const Shape shape : {Shape::kPlane, Shape::kSphere, Shape::kTexture}) {
    const Scene scene{shape, -0.001};
    for (int i = 0; i < 100'000; ++i) {
      const Vector3 a{coordinate(random), coordinate(random), coordinate(random)};
      const Vector3 b{coordinate(random), coordinate(random), coordinate(random)};
      const double near_m = std::pow(10.0, -6 * (i % 100) / 100.0);
      const Vector3 c = sum(a, scaled(difference(b, a), near_m));
      ASSERT_LE(std::abs(scene.clearance_m(a) - scene.clearance_m(c)),
                length(difference(a, c)) + 1e-15);
    }
    EXPECT_LE(scene.clearance_m({0, 0, -0.0010001}), 0) << "the highest point is at the face";
    EXPECT_GE(scene.clearance_m({0, 0, -0.0009999}), 0);
  }
}

TEST(Plane, PutsTheProxyStraightAboveTheDevice) {
  GodObject object({Shape::kPlane, 0.005}, kSpring);
  static_cast<void>(object.touch(sample_at({0, 0, 0.02})));
  for (int i = 0; i < 500; ++i) {
    const Vector3 at{0.0001 * i, -0.00005 * i, 0.005 - 0.01 * std::abs(std::sin(0.02 * i))};
    const Touch touch = object.touch(sample_at(at));
    EXPECT_NEAR(touch.proxy_m.x, at.x, 1e-6);
    EXPECT_NEAR(touch.proxy_m.y, at.y, 1e-6);
    EXPECT_NEAR(touch.proxy_m.z, 0.005, 1e-6);
  }
}

TEST(Sphere, PutsTheProxyOnTheNearestPoint) {
  const Scene scene{Shape::kSphere, 0};
  GodObject object(scene, kSpring);
  static_cast<void>(object.touch(sample_at({0, 0, 0.02})));
  for (int i = 0; i < 1000; ++i) {
    const double angle = 0.8 * std::sin(0.01 * i);
    const double depth_m = 0.012 * (1 - std::cos(0.03 * i)) / 2;
    const Vector3 out{std::sin(angle) * std::cos(0.02 * i), std::sin(angle) * std::sin(0.02 * i),
                      std::cos(angle)};
    const Touch touch =
        object.touch(sample_at(sum(scene.centre_m(), scaled(out, Scene::kRadiusMetre - depth_m))));
    const Vector3 nearest = sum(scene.centre_m(), scaled(out, Scene::kRadiusMetre));
    EXPECT_LE(length(difference(touch.proxy_m, nearest)), 2e-6) << i;
  }
}

TEST(Sphere, ChangesItsForceContinuously) {
  // Down to half the radius, the nearest point moves at most twice as fast as the device.
  constexpr double kStepMetre = 0.0002;
  const Scene scene{Shape::kSphere, 0};
  for (unsigned seed = 1; seed <= 50; ++seed) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> step(-kStepMetre, kStepMetre);
    GodObject object(scene, kSpring);
    Vector3 at{0, 0, 0.0005};
    Touch before = object.touch(sample_at(at));
    for (int i = 0; i < 2000; ++i) {
      const Vector3 next = sum(at, {step(random), step(random), step(random) - 0.2 * kStepMetre});
      const double from_centre_m = length(difference(next, scene.centre_m()));
      if (from_centre_m < 0.5 * Scene::kRadiusMetre) continue;
      const Touch touch = object.touch(sample_at(next));
      ASSERT_LE(length(difference(touch.force_newton, before.force_newton)),
                kStiffness * (3 * length(difference(next, at)) + 1e-5))
          << "seed " << seed << ", step " << i;
      before = touch;
      at = next;
    }
  }
}

TEST(Sphere, PushesADeviceBackThatJumpedThroughIt) {
  GodObject object({Shape::kSphere, 0}, kSpring);
  static_cast<void>(object.touch(sample_at({0.02, 0, -0.001})));
  // Near the edge the ball is only a few millimetres thick.
  const Touch jumped = object.touch(sample_at({0.027, 0, -0.05}));
  EXPECT_GT(jumped.depth_m, 0.01);
  EXPECT_GT(jumped.force_newton.z, 0) << "back to where it came from";
}

TEST(Texture, KeepsADeviceFromJumpingThroughARidge) {
  const Scene scene{Shape::kTexture, 0};
  GodObject object(scene, kSpring);
  // Moves from one trough to the next, below the crest between them.
  const double trough_m = Scene::kRidgeSpacingMetre / 2;
  static_cast<void>(object.touch(sample_at({-trough_m, 0, -0.0028})));
  const Touch jumped = object.touch(sample_at({trough_m, 0, -0.0028}));
  EXPECT_LT(jumped.proxy_m.x, 0) << "it does not fly to the far side of the crest";
  EXPECT_LT(jumped.force_newton.x, 0);
}

TEST(Texture, PushesAlongItsSlopesAsAHandStrokesIt) {
  const Scene scene{Shape::kTexture, 0};
  GodObject object(scene, kSpring);
  double left_newton = 0;
  double right_newton = 0;
  for (int i = 0; i < 3000; ++i) {
    const Vector3 at{-0.03 + 0.00002 * i, 0, -kHalfRidge - 0.001};
    const Touch touch = object.touch(sample_at(at));
    expect_lawful(object, touch);
    if (touch.depth_m > 1e-5) {
      const Vector3 normal = scene.normal(touch.proxy_m);
      EXPECT_NEAR(dot(scaled(touch.force_newton, 1 / length(touch.force_newton)), normal), 1, 1e-4)
          << "without friction the force is straight out of the surface";
    }
    left_newton = std::min(left_newton, touch.force_newton.x);
    right_newton = std::max(right_newton, touch.force_newton.x);
  }
  EXPECT_LT(left_newton, -0.2);
  EXPECT_GT(right_newton, 0.2);
}

TEST(Shapes, HaveNames) {
  EXPECT_EQ(to_string(Shape::kPlane), "plane");
  EXPECT_EQ(to_string(Shape::kSphere), "sphere");
  EXPECT_EQ(to_string(Shape::kTexture), "texture");
  EXPECT_EQ(to_string(Shape{7}), "unknown");
}

}  // namespace
}  // namespace rtpm::scene
