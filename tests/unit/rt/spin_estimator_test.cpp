#include "rtpm/rt/spin_estimator.hpp"

#include <gtest/gtest.h>

namespace rtpm::rt {
namespace {

using namespace std::chrono_literals;

constexpr Duration kSpin = 100us;

/// A thread whose pauses the test reports one by one.
class SpinEstimatorTest : public testing::Test {
 protected:
  /// Whether the thread spins at the start of a pause of this length.
  bool spins(Duration pause) {
    const bool does = estimator_.on_idle(now_, kSpin);
    now_ += pause;
    estimator_.on_work(now_);
    now_ += 5us;
    return does;
  }
  /// The number of the next pauses of this length in which the thread spins.
  int count(int pauses, Duration pause) {
    int spun = 0;
    for (int i = 0; i < pauses; ++i)
      spun += spins(pause) ? 1 : 0;
    return spun;
  }

 private:
  SpinEstimator estimator_;
  MonotonicTime now_{1'000s};
};

TEST_F(SpinEstimatorTest, SpinsByDefault) {
  EXPECT_TRUE(spins(20us));
  EXPECT_EQ(count(1000, 20us), 1000);
}

TEST_F(SpinEstimatorTest, StopsSpinningWhenCallsComeTooLate) {
  EXPECT_LE(count(1000, 1ms), 20);
  EXPECT_EQ(count(1000, 1ms), 0);
}

TEST_F(SpinEstimatorTest, SpinsAgainAfterACallInTime) {
  count(1000, 1ms);
  EXPECT_FALSE(spins(20us)) << "it blocked, and would have been better off";
  EXPECT_TRUE(spins(20us));
}

TEST_F(SpinEstimatorTest, SpinsForACallerThatCallsTwiceInEachTurn) {
  count(1000, 1ms);
  spins(20us);
  int spun = 0;
  for (int turn = 0; turn < 100; ++turn) {
    spun += spins(1ms) ? 1 : 0;
    EXPECT_TRUE(spins(20us)) << "in turn " << turn;
  }
  EXPECT_GT(spun, 90) << "which of the two pauses comes next it does not know";
}

TEST_F(SpinEstimatorTest, IgnoresTheTimeOfFormerWork) {
  SpinEstimator estimator;
  MonotonicTime now{1s};
  // The ring brings no work: the time of the last work stays the same.
  for (int i = 0; i < 100; ++i) {
    const MonotonicTime work = now;
    now += 5us;
    static_cast<void>(estimator.on_idle(now, kSpin));
    estimator.on_work(work);
    now += 1ms;
    estimator.on_work(now);
  }
  EXPECT_FALSE(estimator.on_idle(now, kSpin));
}

}  // namespace
}  // namespace rtpm::rt
