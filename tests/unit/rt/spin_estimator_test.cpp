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
    const bool does = sense_.on_idle(now_, kSpin);
    now_ += pause;
    sense_.on_work(now_);
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
  SpinEstimator sense_;
  MonotonicTime now_{1'000s};
};

TEST_F(SpinEstimatorTest, SpinsUntilItKnowsBetter) {
  EXPECT_TRUE(spins(20us));
  EXPECT_EQ(count(1000, 20us), 1000);
}

TEST_F(SpinEstimatorTest, GivesUpWhereTheNextCallNeverComesInTime) {
  EXPECT_LE(count(1000, 1ms), 20);
  EXPECT_EQ(count(1000, 1ms), 0);
}

TEST_F(SpinEstimatorTest, SpinsAgainAfterTheFirstCallThatCameInTime) {
  count(1000, 1ms);
  EXPECT_FALSE(spins(20us)) << "it blocked, and would have been better off";
  EXPECT_TRUE(spins(20us));
}

TEST_F(SpinEstimatorTest, SpinsForACallerThatCallsTwiceInARow) {
  count(1000, 1ms);
  spins(20us);
  int spun = 0;
  for (int turn = 0; turn < 100; ++turn) {
    spun += spins(1ms) ? 1 : 0;
    EXPECT_TRUE(spins(20us)) << "in turn " << turn;
  }
  EXPECT_GT(spun, 90) << "which of the two pauses comes next it does not know";
}

TEST_F(SpinEstimatorTest, TakesWorkOfBeforeForNothingNew) {
  SpinEstimator sense;
  MonotonicTime now{1s};
  // The ring brings no work: the time of the last work stays the same.
  for (int i = 0; i < 100; ++i) {
    const MonotonicTime work = now;
    now += 5us;
    static_cast<void>(sense.on_idle(now, kSpin));
    sense.on_work(work);
    now += 1ms;
    sense.on_work(now);
  }
  EXPECT_FALSE(sense.on_idle(now, kSpin));
}

}  // namespace
}  // namespace rtpm::rt
