#include "rtpm/models/evaluator.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <random>
#include <vector>

#include "random_model.hpp"

namespace rtpm::gvd {
namespace {

using driver::Vector3;

driver::Sample sample_at(const Vector3& position_m, const Vector3& velocity_m_per_s = {}) {
  driver::Sample sample;
  sample.pose.position_m = position_m;
  sample.twist.linear_m_per_s = velocity_m_per_s;
  return sample;
}

/// The force of `model` alone, at its first evaluation.
Vector3 force_of(const Model& model, const Vector3& position_m,
                 const Vector3& velocity_m_per_s = {}) {
  Evaluator evaluator;
  evaluator.set(ModelList{std::vector{model}});
  return evaluator.evaluate(sample_at(position_m, velocity_m_per_s)).wrench.force_newton;
}

void expect_near(const Vector3& is, const Vector3& expected) {
  EXPECT_NEAR(is.x, expected.x, 1e-12);
  EXPECT_NEAR(is.y, expected.y, 1e-12);
  EXPECT_NEAR(is.z, expected.z, 1e-12);
}

double distance(const Vector3& a, const Vector3& b) {
  return std::hypot(a.x - b.x, a.y - b.y, a.z - b.z);
}

TEST(PlaneForce, IsASpringAndADamperAlongTheNormalThatNeverPulls) {
  const Plane wall{{0, 0, 0.01}, {0, 0, 1}, 1000, 2};
  expect_near(force_of(wall, {0.5, 0.5, 0.010}), {});
  expect_near(force_of(wall, {0.5, 0.5, 0.008}), {0, 0, 2});
  expect_near(force_of(wall, {0, 0, 0.008}, {9, 9, -0.5}), {0, 0, 3});
  expect_near(force_of(wall, {0, 0, 0.008}, {0, 0, 5}), {});
  expect_near(force_of(wall, {0, 0, 0.011}, {0, 0, -5}), {});
  const double c = std::numbers::sqrt2 / 2;
  expect_near(force_of(Plane{{}, {c, c, 0}, 1000, 0}, {-0.001, -0.001, 0}), {1, 1, 0});
}

TEST(SphereForce, LeadsOutOfABallAndIntoACavity) {
  const Vector3 centre{0.01, 0, 0};
  const Sphere ball{centre, 0.02, Side::kSolid, 500, 1};
  expect_near(force_of(ball, {0.031, 0, 0}), {});
  expect_near(force_of(ball, {0.026, 0, 0}), {2, 0, 0});
  expect_near(force_of(ball, {0.01, 0, -0.016}, {0, 0, 1}), {0, 0, -3});
  expect_near(force_of(ball, centre), {});
  const Sphere cavity{centre, 0.02, Side::kHollow, 500, 1};
  expect_near(force_of(cavity, {0.029, 0, 0}), {});
  expect_near(force_of(cavity, {0.034, 0, 0}), {-2, 0, 0});
  expect_near(force_of(cavity, centre), {});
}

TEST(BoxForce, LeadsToTheNearestFaceOfABoxAndTheNearestPointOfARoom) {
  const Box box{{-0.02, -0.02, -0.02}, {0.02, 0.02, 0.02}, Side::kSolid, 500, 0};
  expect_near(force_of(box, {0.021, 0, 0}), {});
  expect_near(force_of(box, {0.016, 0.001, 0}), {2, 0, 0});
  expect_near(force_of(box, {0, -0.016, 0.001}), {0, -2, 0});
  expect_near(force_of(box, {0, 0, 0.018}), {0, 0, 1});
  Box room = box;
  room.side = Side::kHollow;
  expect_near(force_of(room, {0.019, -0.019, 0.019}), {});
  expect_near(force_of(room, {0.022, 0, 0}), {-1, 0, 0});
  expect_near(force_of(room, {0.023, -0.024, 0}), {-1.5, 2, 0});
}

TEST(SpringForce, PullsToItsAnchorUpToItsMaximum) {
  const Spring spring{{0, 0.01, 0}, 100, 2, 1.5};
  expect_near(force_of(spring, {0, 0.01, 0}), {});
  expect_near(force_of(spring, {0, 0, 0}), {0, 1, 0});
  expect_near(force_of(spring, {0, 1, 0}), {0, -1.5, 0});
  expect_near(force_of(spring, {0, 0.01, 0}, {1, 0, 0}), {-2, 0, 0});
}

TEST(FieldForce, IsAffineInItsBallAndFadesOutAtTheEdge) {
  AffineField field{{0.01, 0, 0}, {1, 0, 0}, {0, 10, 0, -20, 0, 0, 0, 0, 30}, 0.05, 0.01};
  expect_near(force_of(field, {0.01, 0, 0}), {1, 0, 0});
  expect_near(force_of(field, {0.03, 0.01, -0.02}), {1 + 10 * 0.01, -20 * 0.02, 30 * -0.02});
  const Vector3 whole = force_of(field, {0.01 + 0.05, 0, 0});
  expect_near(whole, {1, -20 * 0.05, 0});
  expect_near(force_of(field, {0.01 + 0.055, 0, 0}), {0.5, -20 * 0.055 / 2, 0});
  expect_near(force_of(field, {0.01 + 0.06, 0, 0}), {});
  expect_near(force_of(field, {5, 5, 5}), {});
}

TEST(FrictionForce, SticksThenSlidesAndNeverDrifts) {
  Evaluator evaluator;
  evaluator.set(ModelList{std::vector<Model>{Friction{0.5, 1000, 0}}});
  const auto force_at = [&](double x_m) {
    return evaluator.evaluate(sample_at({x_m, 0, 0})).wrench.force_newton.x;
  };
  EXPECT_EQ(force_at(0.020), 0) << "it touches where the end effector is";
  EXPECT_NEAR(force_at(0.0204), -0.4, 1e-9) << "sticks";
  EXPECT_NEAR(force_at(0.020), 0, 1e-9);
  EXPECT_NEAR(force_at(0.030), -0.5, 1e-9) << "slides";
  EXPECT_NEAR(force_at(0.0295), 0, 1e-9) << "the contact point follows at force / stiffness";
  EXPECT_NEAR(force_at(0.010), 0.5, 1e-9);
  for (int i = 0; i < 1000; ++i)
    ASSERT_NEAR(force_at(0.0102), 0.3, 1e-9) << "does not creep";
}

TEST(FrictionForce, IsViscousWithoutDryFriction) {
  expect_near(force_of(Friction{0, 0, 0.5}, {0.3, 0.2, 0.1}, {1, -2, 4}), {-0.5, 1, -2});
}

TEST(DetentsForce, IsASineAlongTheLine) {
  const Detents detents{{0.001, 0, 0}, {1, 0, 0}, 0.01, 0.8, 0.5};
  for (const double multiple : {-2.0, 0.0, 3.0})
    EXPECT_NEAR(force_of(detents, {0.001 + multiple * 0.01, 0.5, -0.5}).x, 0, 1e-9);
  expect_near(force_of(detents, {0.0035, 0, 0}), {-0.8, 0, 0});
  expect_near(force_of(detents, {-0.0015, 0, 0}), {0.8, 0, 0});
  expect_near(force_of(detents, {0.001, 0, 0}, {1, 1, 1}), {-0.5, 0, 0});
}

TEST(DialDetentsEffort, IsASineWithEndStops) {
  Evaluator evaluator;
  const DialDetents detents{.joint = 2,
                            .spacing_rad = 0.5,
                            .effort_newton_metre = 0.01,
                            .damping_newton_metre_s_per_rad = 0.001,
                            .low_rad = -1,
                            .high_rad = 1,
                            .end_stiffness_newton_metre_per_rad = 2};
  evaluator.set(ModelList{std::vector<Model>{detents}});
  const auto effort_at = [&](double angle_rad, double velocity_rad_per_s = 0) {
    driver::Sample sample;
    sample.joints[2] = angle_rad;
    sample.joint_velocities[2] = velocity_rad_per_s;
    const ModelForces forces = evaluator.evaluate(sample);
    EXPECT_EQ(forces.wrench, driver::Wrench{});
    EXPECT_EQ(forces.efforts[0], 0);
    return forces.efforts[2];
  };
  EXPECT_NEAR(effort_at(0.5), 0, 1e-12);
  EXPECT_NEAR(effort_at(0.125), -0.01, 1e-12);
  EXPECT_NEAR(effort_at(-0.125), 0.01, 1e-12);
  EXPECT_NEAR(effort_at(0.5, 3), -0.003, 1e-12);
  EXPECT_NEAR(effort_at(1.01), -0.02, 1e-12);
  EXPECT_NEAR(effort_at(-1.01), 0.02, 1e-12);
}

TEST(Evaluator, AddsItsModelsUp) {
  Evaluator evaluator;
  EXPECT_TRUE(evaluator.is_empty());
  evaluator.set(ModelList{std::vector<Model>{Plane{{}, {0, 0, 1}, 1000, 0},
                                             Plane{{}, {1, 0, 0}, 500, 0}, Friction{0, 0, 1}}});
  const auto forces = evaluator.evaluate(sample_at({-0.002, 0, -0.003}, {0, 1, 0}));
  expect_near(forces.wrench.force_newton, {1, -1, 3});
  EXPECT_EQ(forces.wrench.torque_newton_metre, Vector3{});
  evaluator.clear();
  EXPECT_TRUE(evaluator.is_empty());
  expect_near(evaluator.evaluate(sample_at({-1, -1, -1})).wrench.force_newton, {});
}

TEST(Evaluator, KeepsTheStateOfModelsThatStay) {
  const Model friction = Friction{0.5, 1000, 0};
  Evaluator evaluator;
  evaluator.set(ModelList{std::vector{friction}});
  static_cast<void>(evaluator.evaluate(sample_at({})));
  const auto force = [&] {
    return evaluator.evaluate(sample_at({0.0003, 0, 0})).wrench.force_newton.x;
  };
  EXPECT_NEAR(force(), -0.3, 1e-12);
  evaluator.set(ModelList{std::vector{friction, Model{Plane{}}}});
  EXPECT_NEAR(force(), -0.3, 1e-12) << "the same model at the same index";
  evaluator.set(ModelList{std::vector<Model>{Friction{0.5, 900, 0}}});
  EXPECT_EQ(force(), 0) << "another model starts anew";
  evaluator.clear();
  evaluator.set(ModelList{std::vector{friction}});
  EXPECT_EQ(force(), 0);
}

TEST(Evaluator, IsFiniteForEveryFiniteSample) {
  const double most = std::numeric_limits<double>::max();
  std::mt19937_64 random(7);
  for (int turn = 0; turn < 500; ++turn) {
    Evaluator evaluator;
    evaluator.set(test::random_list(random));
    for (const double far : {most, -most, 1e160, 1.0, 0.0}) {
      driver::Sample sample = sample_at({far, -far, far}, {far, far, -far});
      sample.joints.fill(far);
      sample.joint_velocities.fill(-far);
      const ModelForces forces = evaluator.evaluate(sample);
      EXPECT_TRUE(std::isfinite(forces.wrench.force_newton.x) &&
                  std::isfinite(forces.wrench.force_newton.y) &&
                  std::isfinite(forces.wrench.force_newton.z));
      for (const double effort : forces.efforts)
        EXPECT_TRUE(std::isfinite(effort));
    }
    // A friction model's state survives it.
    EXPECT_TRUE(std::isfinite(evaluator.evaluate(sample_at({})).wrench.force_newton.x));
  }
}

// The stiffness that check() admits is the steepest slope of the field, including its edges. A
// solid box and the centre of a ball have edges within the material, see Box and Sphere.
TEST(Evaluator, HasNoStepsAndNoSlopeAboveTheStiffnessThatWasChecked) {
  const ModelLimits limits = test::arm_limits();
  std::mt19937_64 random(8);
  std::uniform_real_distribution<double> within(-0.15, 0.15);
  for (int turn = 0; turn < 2000; ++turn) {
    Model model = test::random_model(random);
    if (auto* box = std::get_if<Box>(&model)) box->side = Side::kHollow;
    if (auto* sphere = std::get_if<Sphere>(&model)) sphere->side = Side::kHollow;
    Vector3 at{within(random), within(random), within(random)};
    const Vector3 end{within(random), within(random), within(random)};
    Evaluator evaluator;
    evaluator.set(ModelList{std::vector{model}});
    Vector3 force = evaluator.evaluate(sample_at(at)).wrench.force_newton;
    constexpr int kSteps = 200;
    const Vector3 step{(end.x - at.x) / kSteps, (end.y - at.y) / kSteps, (end.z - at.z) / kSteps};
    const double way_m = distance(step, {});
    for (int i = 0; i < kSteps; ++i) {
      at = {at.x + step.x, at.y + step.y, at.z + step.z};
      const Vector3 next = evaluator.evaluate(sample_at(at)).wrench.force_newton;
      ASSERT_LE(distance(force, next),
                limits.stiffness_newton_per_m_max * way_m * (1 + 1e-6) + 1e-9)
          << to_string(model) << " of turn " << turn;
      force = next;
    }
  }
}

}  // namespace
}  // namespace rtpm::gvd
