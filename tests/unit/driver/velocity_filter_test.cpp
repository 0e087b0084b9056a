#include "rtpm/driver/velocity_filter.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace rtpm::driver {
namespace {

constexpr double kCount = 25e-6;
constexpr Duration kPeriod = std::chrono::milliseconds{1};

/// The reading of an encoder.
double counted(double position) {
  return std::floor(position / kCount) * kCount;
}

/// The largest errors of the filter and of the plain difference at a steady velocity.
struct Errors {
  double filter = 0;
  double difference = 0;
};
Errors errors_at(double velocity) {
  VelocityFilter filter(kCount);
  Errors errors;
  double before = 0;
  for (int i = 0; i < 1000; ++i) {
    const MonotonicTime now{i * kPeriod};
    const double position = counted(velocity * 1e-3 * i);
    const double filtered = filter.add(now, position);
    if (i > 2 * static_cast<int>(VelocityFilter::kWindow)) {
      errors.filter = std::max(errors.filter, std::abs(filtered - velocity));
      errors.difference =
          std::max(errors.difference, std::abs((position - before) / 1e-3 - velocity));
    }
    before = position;
  }
  return errors;
}

TEST(VelocityFilter, IsSmootherThanADifferenceAtEverySpeed) {
  for (const double velocity : {0.001, 0.0123, -0.04, 0.2, 1.234}) {
    const Errors errors = errors_at(velocity);
    EXPECT_LT(errors.filter, 0.3 * errors.difference) << velocity;
    EXPECT_LE(errors.filter, 2 * kCount / (VelocityFilter::kWindow * 1e-3)) << velocity;
  }
}

TEST(VelocityFilter, FollowsAQuickChangeAtOnce) {
  VelocityFilter filter(kCount);
  double position = 0;
  int i = 0;
  for (; i < 100; ++i)
    filter.add(MonotonicTime{i * kPeriod}, position);
  EXPECT_EQ(filter.velocity(), 0);
  for (const int end = i + 4; i < end; ++i)
    filter.add(MonotonicTime{i * kPeriod}, position += 1e-3);
  EXPECT_NEAR(filter.velocity(), 1, 0.03) << "of 1 m/s after 4 ms";
}

TEST(VelocityFilter, KeepsItsValueWithoutANewPosition) {
  VelocityFilter filter(kCount);
  EXPECT_EQ(filter.add(MonotonicTime{}, 1), 0);
  const double before = filter.add(MonotonicTime{kPeriod}, 1.001);
  EXPECT_EQ(filter.velocity(), before);
  EXPECT_NEAR(before, 1, 1e-9);
  EXPECT_EQ(filter.add(MonotonicTime{kPeriod}, 5), before) << "the same time";
  EXPECT_EQ(filter.add(MonotonicTime{}, 5), before) << "an older one";
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(filter.add(MonotonicTime{2 * kPeriod}, nan), before);
  filter.reset();
  EXPECT_EQ(filter.velocity(), 0);
  EXPECT_EQ(filter.add(MonotonicTime{}, 7), 0);
}

}  // namespace
}  // namespace rtpm::driver
