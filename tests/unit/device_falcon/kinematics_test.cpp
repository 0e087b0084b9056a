#include "rtpm/device_falcon/kinematics.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <vector>

namespace rtpm::device_falcon {
namespace {

using driver::Vector3;

constexpr Vector3 kCentre{0, 0, 0.125};
constexpr double kForceMax = 8;
constexpr double kScale = 10'000;

double length(const Vector3& v) {
  return std::hypot(v.x, v.y, v.z);
}
double product(const Vector3& a, const Vector3& b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}

struct Fixture {
  LegCounts counts;
  Vector3 position_mm;
};

/// Computed from the reference's formulae, independently of this code.
const std::vector<Fixture>& fixtures() {
  static const std::vector<Fixture> kFixtures{
      {{0, 0, 0}, {0, 0, 134.60243}},          {{-500, -500, -500}, {0, 0, 110.75450}},
      {{500, 500, 500}, {0, 0, 156.86047}},    {{100, -200, 300}, {18.23233, 3.97823, 136.13342}},
      {{1000, 1000, 1000}, {0, 0, 173.60325}}, {{-1000, -1000, -1000}, {0, 0, 89.61060}}};
  return kFixtures;
}

TEST(FalconKinematics, MeetsTheReferencePositions) {
  for (const Fixture& fixture : fixtures()) {
    const auto at = forward(upper_angles(fixture.counts), kCentre);
    ASSERT_TRUE(at);
    EXPECT_NEAR(at->x, fixture.position_mm.x / 1000, 1e-6);
    EXPECT_NEAR(at->y, fixture.position_mm.y / 1000, 1e-6);
    EXPECT_NEAR(at->z, fixture.position_mm.z / 1000, 1e-6);
  }
}

/// Positions in the workspace, and slightly beyond it.
class Positions {
 public:
  Vector3 next() {
    while (true) {
      const Vector3 from_centre{side_(random_), side_(random_), side_(random_)};
      if (length(from_centre) > kRadius) continue;
      return {from_centre.x, from_centre.y, kCentre.z + from_centre.z};
    }
  }
  std::mt19937_64& random() { return random_; }

 private:
  static constexpr double kRadius = 0.045;
  std::mt19937_64 random_{1};
  std::uniform_real_distribution<double> side_{-kRadius, kRadius};
};

TEST(FalconKinematics, ForwardUndoesInverseFromTheCentre) {
  Positions positions;
  for (int i = 0; i < 2000; ++i) {
    const Vector3 wanted = positions.next();
    const auto angles = inverse(wanted);
    ASSERT_TRUE(angles);
    const auto found = forward(angles->upper, kCentre);
    ASSERT_TRUE(found) << wanted.x << ' ' << wanted.y << ' ' << wanted.z;
    EXPECT_NEAR(found->x, wanted.x, 1e-9);
    EXPECT_NEAR(found->y, wanted.y, 1e-9);
    EXPECT_NEAR(found->z, wanted.z, 1e-9);
  }
}

TEST(FalconKinematics, JacobianAgreesWithFiniteDifferences) {
  constexpr double kStep = 1e-6;
  Positions positions;
  for (int i = 0; i < 500; ++i) {
    const Vector3 at = positions.next();
    const auto angles = inverse(at);
    ASSERT_TRUE(angles);
    const Matrix3 rates = jacobian(*angles);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const auto shifted = [&](double by) {
        Vector3 moved = at;
        (axis == 0 ? moved.x : axis == 1 ? moved.y : moved.z) += by;
        return inverse(moved)->upper;
      };
      const auto ahead = shifted(kStep);
      const auto behind = shifted(-kStep);
      for (std::size_t leg = 0; leg < 3; ++leg) {
        const double difference = (ahead[leg] - behind[leg]) / (2 * kStep);
        ASSERT_NEAR(rates[leg][axis], difference, 1e-6 * std::max(1.0, std::abs(difference)));
      }
    }
  }
}

TEST(FalconKinematics, RefusesUnreachablePositions) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  for (const double wrong : {kNan, kInfinity, -kInfinity, 1e308, 9.0}) {
    EXPECT_FALSE(inverse({wrong, 0, 0.125}));
    EXPECT_FALSE(inverse({0, wrong, 0.125}));
    EXPECT_FALSE(inverse({0, 0, wrong}));
    EXPECT_FALSE(forward({wrong, 0.6, 0.6}, kCentre)) << wrong;
    EXPECT_FALSE(forward({0.6, 0.6, 0.6}, {wrong, 0, 0}));
  }
  EXPECT_FALSE(forward(upper_angles({32767, 32767, 32767}), kCentre));
  EXPECT_FALSE(forward(upper_angles({-32768, 32767, 0}), kCentre));
}

TEST(FalconForce, MatchesTheReferenceCounts) {
  const auto unlimited = [](const Vector3& force) {
    return motor_force(force, kCentre, 1000, kScale);
  };
  for (const std::int16_t count : unlimited({0, 0, 8}).counts)
    EXPECT_NEAR(std::abs(count), 2019, 2);
  // 8 N to the side takes 4848 counts on one leg, so that 6 N still fit.
  int largest = 0;
  for (const std::int16_t count : unlimited({6, 0, 0}).counts)
    largest = std::max(largest, std::abs(count));
  EXPECT_NEAR(largest, 4848 * 6 / 8, 2);
  EXPECT_FALSE(unlimited({6, 0, 0}).is_saturated);
  EXPECT_TRUE(unlimited({8, 0, 0}).is_saturated);
}

TEST(FalconForce, IsThatOfTheMotors) {
  Positions positions;
  for (int i = 0; i < 200; ++i) {
    const Vector3 at = positions.next();
    const MotorForce force = motor_force({1, -2, 1.5}, at, kForceMax, kScale);
    const Vector3 made = force_of(force.counts, at, kScale);
    EXPECT_NEAR(made.x, force.applied_newton.x, 0.01);
    EXPECT_NEAR(made.y, force.applied_newton.y, 0.01);
    EXPECT_NEAR(made.z, force.applied_newton.z, 0.01);
  }
}

TEST(FalconForce, IsZeroForNonFiniteNumbersAndUnreachablePositions) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  for (const double wrong : {kNan, kInfinity, -kInfinity}) {
    for (const Vector3& force :
         {Vector3{wrong, 0, 0}, Vector3{1, wrong, 0}, Vector3{1, 2, wrong}}) {
      const MotorForce none = motor_force(force, kCentre, kForceMax, kScale);
      EXPECT_EQ(none.counts, LegCounts{});
      EXPECT_EQ(none.applied_newton, Vector3{});
      EXPECT_TRUE(none.is_saturated);
    }
    EXPECT_EQ(motor_force({1, 1, 1}, {wrong, 0, 0.1}, kForceMax, kScale).counts, LegCounts{});
  }
  EXPECT_EQ(motor_force({1, 1, 1}, {0.5, 0, 0.1}, kForceMax, kScale).counts, LegCounts{});
}

/// Checks one force: it is within the motors' range, flips no sign, and keeps its direction.
void expect_sound(const Vector3& force, const Vector3& at, double scale) {
  SCOPED_TRACE(testing::Message() << force.x << ' ' << force.y << ' ' << force.z << " at " << at.x
                                  << ' ' << at.y << ' ' << at.z << " scale " << scale);
  const MotorForce result = motor_force(force, at, kForceMax, scale);
  // A force of a thousandth of a newton in the same direction, which saturates nothing.
  const double largest =
      std::max({std::abs(force.x), std::abs(force.y), std::abs(force.z), 5e-324});
  const double shrink = 1e-3 * (1 / std::max(largest, 1e-300));
  const Vector3 unit{force.x * shrink, force.y * shrink, force.z * shrink};
  const MotorForce reference = motor_force(unit, at, kForceMax, 1e9 / 4000);
  for (std::size_t leg = 0; leg < 3; ++leg) {
    ASSERT_LE(std::abs(result.counts[leg]), kMotorCountMax);
    ASSERT_GE(result.counts[leg] * reference.counts[leg], 0) << "leg " << leg;
  }
  const Vector3& applied = result.applied_newton;
  ASSERT_TRUE(std::isfinite(applied.x) && std::isfinite(applied.y) && std::isfinite(applied.z));
  ASSERT_LE(length(applied), kForceMax * (1 + 1e-12));
  if (length(applied) < 1e-300 || length(unit) < 1e-300) return;
  const double alignment = product(applied, unit) / length(applied) / length(unit);
  ASSERT_NEAR(alignment, 1, 1e-9);
  if (length(applied) < 0.5) return;
  const Vector3 made = force_of(result.counts, at, scale);
  ASSERT_NEAR(product(made, applied) / length(made) / length(applied), 1, 1e-3);
}

TEST(FalconForce, KeepsRangeSignAndDirectionForEveryFiniteInput) {
  constexpr double kDenormal = 5e-324;
  constexpr double kHuge = std::numeric_limits<double>::max();
  const std::vector<double> special{0,    -0.0,   kDenormal, -kDenormal, 1e-310, 1e-9,  -1e-9,
                                    1,    -3,     8,         -100,       1e4,    32768, -65536,
                                    1e18, -1e155, 1e308,     -kHuge,     kHuge};
  Positions positions;
  for (const double x : special) {
    for (const double y : special) {
      for (const double z : special) {
        expect_sound({x, y, z}, positions.next(), kScale);
        if (testing::Test::HasFatalFailure()) return;
      }
    }
  }
  std::uniform_real_distribution<double> exponent(-12, 20);
  std::uniform_real_distribution<double> share(-1, 1);
  std::uniform_real_distribution<double> scale(1000, 100'000);
  for (int i = 0; i < 50'000; ++i) {
    std::mt19937_64& random = positions.random();
    const double size = std::pow(10, exponent(random));
    expect_sound({size * share(random), size * share(random), size * share(random)},
                 positions.next(), scale(random));
    if (testing::Test::HasFatalFailure()) return;
  }
}

}  // namespace
}  // namespace rtpm::device_falcon
