#include "rtpm/models/check.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <random>
#include <string>
#include <vector>

#include "random_model.hpp"

namespace rtpm::gvd {
namespace {

using std::chrono::milliseconds;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

expected<void, ModelError> checked(const Model& model) {
  return check(ModelList{std::vector{model}}, test::arm_limits());
}

/// The name of the rejected field, or "" if the model passed.
std::string refused(const Model& model) {
  const auto result = checked(model);
  return result ? "" : std::string(result.error().field);
}

TEST(ModelCheck, PassesModelsThatTheDeviceCanRender) {
  EXPECT_TRUE(check(ModelList{}, ModelLimits{})) << "an empty list suits every device";
  std::mt19937_64 random(1);
  for (int i = 0; i < 2000; ++i) {
    const ModelList list = test::random_list(random);
    const auto result = check(list, test::arm_limits());
    ASSERT_TRUE(result) << to_text(result.error());
  }
}

TEST(ModelCheck, RefusesEveryNonFiniteNumber) {
  const Plane plane{{}, {0, 0, 1}, 100, 0};
  const Sphere ball{{}, 0.02, Side::kSolid, 100, 0};
  const Box box{{}, {1, 1, 1}, Side::kSolid, 100, 0};
  const Spring spring{{}, 100, 0, 1};
  const AffineField field{{}, {1, 0, 0}, {}, 0.1, 0.1};
  const Friction friction{0.5, 100, 0.1};
  const Detents detents{{}, {1, 0, 0}, 0.01, 0.1, 0};
  const DialDetents dial{.spacing_rad = 0.3, .effort_newton_metre = 0.01};
  for (const Model& good :
       std::vector<Model>{plane, ball, box, spring, field, friction, detents, dial})
    ASSERT_EQ(refused(good), "") << to_string(good);

  for (const double bad : {kNan, kInfinity, -kInfinity}) {
    // Each case copies its good model and spoils one field.
    const auto with = [bad](auto model, auto field_of) {
      field_of(model) = bad;
      return refused(model);
    };
    EXPECT_EQ(with(plane, [](Plane& m) -> double& { return m.point_m.y; }), "point_m");
    EXPECT_EQ(with(plane, [](Plane& m) -> double& { return m.normal.x; }), "normal");
    EXPECT_EQ(with(plane, [](Plane& m) -> double& { return m.stiffness_newton_per_m; }),
              "stiffness_newton_per_m");
    EXPECT_EQ(with(plane, [](Plane& m) -> double& { return m.damping_newton_s_per_m; }),
              "damping_newton_s_per_m");
    EXPECT_EQ(with(ball, [](Sphere& m) -> double& { return m.centre_m.z; }), "centre_m");
    EXPECT_EQ(with(ball, [](Sphere& m) -> double& { return m.radius_m; }), "radius_m");
    EXPECT_EQ(with(box, [](Box& m) -> double& { return m.low_m.x; }), "low_m");
    EXPECT_EQ(with(box, [](Box& m) -> double& { return m.high_m.z; }), "high_m");
    EXPECT_EQ(with(spring, [](Spring& m) -> double& { return m.anchor_m.x; }), "anchor_m");
    EXPECT_EQ(with(spring, [](Spring& m) -> double& { return m.force_newton_max; }),
              "force_newton_max");
    EXPECT_EQ(with(field, [](AffineField& m) -> double& { return m.origin_m.x; }), "origin_m");
    EXPECT_EQ(with(field, [](AffineField& m) -> double& { return m.force_newton.x; }),
              "force_newton");
    EXPECT_EQ(with(field, [](AffineField& m) -> double& { return m.jacobian_newton_per_m[4]; }),
              "jacobian_newton_per_m");
    EXPECT_EQ(with(field, [](AffineField& m) -> double& { return m.radius_m; }), "radius_m");
    EXPECT_EQ(with(field, [](AffineField& m) -> double& { return m.fade_m; }), "fade_m");
    EXPECT_EQ(with(friction, [](Friction& m) -> double& { return m.force_newton; }),
              "force_newton");
    EXPECT_EQ(with(friction, [](Friction& m) -> double& { return m.stiffness_newton_per_m; }),
              "stiffness_newton_per_m");
    EXPECT_EQ(with(friction, [](Friction& m) -> double& { return m.viscosity_newton_s_per_m; }),
              "viscosity_newton_s_per_m");
    EXPECT_EQ(with(detents, [](Detents& m) -> double& { return m.origin_m.x; }), "origin_m");
    EXPECT_EQ(with(detents, [](Detents& m) -> double& { return m.direction.z; }), "direction");
    EXPECT_EQ(with(detents, [](Detents& m) -> double& { return m.spacing_m; }), "spacing_m");
    EXPECT_EQ(with(dial, [](DialDetents& m) -> double& { return m.origin_rad; }), "origin_rad");
    EXPECT_EQ(with(dial, [](DialDetents& m) -> double& { return m.spacing_rad; }), "spacing_rad");
    EXPECT_EQ(with(dial, [](DialDetents& m) -> double& { return m.effort_newton_metre; }),
              "effort_newton_metre");
    EXPECT_EQ(with(dial, [](DialDetents& m) -> double& { return m.low_rad; }), "low_rad");
    EXPECT_EQ(with(dial, [](DialDetents& m) -> double& { return m.high_rad; }), "high_rad");
  }
}

TEST(ModelCheck, RefusesModelsThatNoLoopKeepsStable) {
  const double stiffness_max = test::arm_limits().stiffness_newton_per_m_max;
  EXPECT_EQ(refused(Plane{{}, {0, 0, 1}, stiffness_max, 0}), "");
  EXPECT_EQ(refused(Plane{{}, {0, 0, 1}, stiffness_max * 1.01, 0}), "stiffness_newton_per_m");
  EXPECT_EQ(refused(Plane{{}, {0, 0, 1}, -1, 0}), "stiffness_newton_per_m");
  EXPECT_EQ(refused(Plane{{}, {0, 0, 1}, 0, 2.4}), "");
  EXPECT_EQ(refused(Plane{{}, {0, 0, 1}, stiffness_max / 2, 2.4}), "damping_newton_s_per_m")
      << "stiffness and damping share the passive range";
  EXPECT_EQ(refused(Plane{{}, {0, 0, 2}, 1, 0}), "normal");
  EXPECT_EQ(refused(Spring{{}, 100, 0, 9.1}), "force_newton_max");
  EXPECT_EQ(refused(Friction{0.5, 0, 0}), "stiffness_newton_per_m");
  EXPECT_EQ(refused(Detents{{}, {1, 0, 0}, 0.001, 1, 0}), "force_newton") << "6283 N/m";
  EXPECT_EQ(refused(Sphere{{}, 0, Side::kSolid, 1, 0}), "radius_m");
  EXPECT_EQ(refused(Sphere{{}, 1, static_cast<Side>(2), 1, 0}), "side");
  EXPECT_EQ(refused(Box{{0, 0, 0}, {1, 0, 1}, Side::kSolid, 1, 0}), "high_m");
  EXPECT_EQ(refused(AffineField{{}, {5, 0, 0}, {}, 0.1, 0.001}), "fade_m") << "5000 N/m";
  EXPECT_EQ(refused(AffineField{{}, {}, {500}, 0.1, 0.1}), "jacobian_newton_per_m");
  EXPECT_EQ(refused(DialDetents{.joint = 8, .spacing_rad = 1}), "joint");
  EXPECT_EQ(refused(DialDetents{.joint = 1, .spacing_rad = 1, .effort_newton_metre = 0.01}),
            "effort_newton_metre")
      << "no such motor";
}

TEST(ModelCheck, NamesTheModelTheFieldAndTheRange) {
  std::vector<Model> models(3, Plane{});
  models[2] = Plane{{}, {0, 0, 1}, 1e9, 0};
  const auto result = check(ModelList{models}, test::arm_limits());
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().index, 2u);
  EXPECT_EQ(to_text(result.error()),
            "model 2 (plane): stiffness_newton_per_m is 1e+09; choose 0 to 1600");
}

TEST(ModelLimits, FollowFromTheDevicesDampingAndThePeriod) {
  driver::Descriptor arm = test::arm();
  const auto stiffness = [&arm](Duration period) {
    return ModelLimits::for_device(arm, period).stiffness_newton_per_m_max;
  };
  EXPECT_NEAR(stiffness(milliseconds{1}), 1600, 1e-9) << "the descriptor's own";
  EXPECT_NEAR(stiffness(milliseconds{10}), 2.5 / 0.015, 1e-9) << "a slow loop keeps less passive";
  arm.limits.stiffness_newton_per_m_max = 0;
  EXPECT_NEAR(stiffness(milliseconds{1}), 2.5 / 0.0015, 1e-9) << "unknown: from the damping";
  arm.limits.stiffness_newton_per_m_max = 300;
  arm.limits.damping_newton_s_per_m = 0;
  EXPECT_NEAR(stiffness(milliseconds{2}), 150, 1e-9) << "unknown: from stiffness and rate";
  arm.modes = {};
  EXPECT_EQ(stiffness(milliseconds{1}), 0) << "a device without force renders nothing";
}

}  // namespace
}  // namespace rtpm::gvd
