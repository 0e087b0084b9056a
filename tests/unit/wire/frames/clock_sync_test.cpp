#include <gtest/gtest.h>

#include "frames.hpp"
#include "rtpm/wire/clock_sync.hpp"

// The peer's clock, estimated from calls: spec/hprotocol.md#hp-5.7.
namespace rtpm::wire {
namespace {

using namespace test;
using namespace std::chrono_literals;

/// A peer whose clock is `offset` ahead and runs `ppm` faster, over a path with the given delays.
class ClockSync : public testing::Test {
 protected:
  [[nodiscard]] MonotonicTime theirs(MonotonicTime ours) const {
    const auto since = static_cast<double>((ours - at(0s)).count());
    return ours + offset + Duration{static_cast<Duration::rep>(since * ppm * 1e-6)};
  }
  void probe(MonotonicTime sent, Duration there, Duration service, Duration back) {
    const MonotonicTime arrived = sent + there;
    estimator.add({sent, theirs(arrived), theirs(arrived + service), arrived + service + back});
  }
  void expect_covered(MonotonicTime now) {
    const auto clock = estimator.estimate(now);
    ASSERT_TRUE(clock);
    const Duration truth = theirs(now) - now;
    EXPECT_LE(std::chrono::abs(clock->offset - truth).count(), clock->uncertainty.count());
  }

  Duration offset = 3h;
  double ppm = 0;
  ClockEstimator estimator;
};

TEST_F(ClockSync, IsExactOverASymmetricPath) {
  EXPECT_FALSE(estimator.estimate(at(0s)));
  probe(at(0s), 100us, 5ms, 100us);
  const auto clock = estimator.estimate(at(5ms));
  ASSERT_TRUE(clock);
  EXPECT_EQ(clock->offset, offset);
  EXPECT_LT(clock->uncertainty, 110us);
}

TEST_F(ClockSync, CoversTheErrorOfAnAsymmetricPath) {
  probe(at(0s), 10us, 0us, 990us);
  expect_covered(at(1ms));
  EXPECT_GE(estimator.estimate(at(1ms))->uncertainty, 490us);
  // A quick probe among slow ones determines the estimate.
  probe(at(10ms), 20us, 0us, 30us);
  probe(at(20ms), 500us, 0us, 20us);
  expect_covered(at(21ms));
  EXPECT_LT(estimator.estimate(at(21ms))->uncertainty, 40us);
}

TEST_F(ClockSync, EstimatesTheDriftWithinItsUncertainty) {
  ppm = 80;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    estimator.clear();
    Random random(seed);
    for (int i = 0; i < 1500; ++i) {
      const auto delay = [&] { return Duration{20'000 + static_cast<int>(random() % 30'000)}; };
      probe(at(10ms * i), delay(), 5us, delay());
      if (i % 100 == 99) expect_covered(at(10ms * i + 1ms));
    }
    EXPECT_NEAR(estimator.estimate(at(15s))->drift_ppm, 80, 5);
    expect_covered(at(60s));
  }
}

TEST_F(ClockSync, RestartsForAnotherClock) {
  probe(at(0s), 20us, 0us, 20us);
  offset = -7h;
  probe(at(1s), 20us, 0us, 20us);
  EXPECT_EQ(estimator.estimate(at(1s))->offset, -7h);
}

TEST_F(ClockSync, RejectsInconsistentTimes) {
  estimator.add({at(0s), at(1s), at(5s), at(1ms)});
  estimator.add({at(0s), at(2s), at(1s), at(1ms)});
  EXPECT_FALSE(estimator.estimate(at(1s)));
}

}  // namespace
}  // namespace rtpm::wire
