#include "rtpm/replay/pace.hpp"

#include <gtest/gtest.h>

#include "rtpm/base/time.hpp"

namespace rtpm::replay {
namespace {

using std::chrono::milliseconds;

constexpr MonotonicTime kBegin = time_from_ns(5'000'000'000);

TEST(PaceTest, StandsAtTheBeginningUntilItPlays) {
  const Pace pace({.length = milliseconds{100}});
  EXPECT_EQ(pace.position(kBegin).at, Duration{0});
  EXPECT_FALSE(pace.is_over(kBegin));
  EXPECT_EQ(pace.due({milliseconds{1}}), kNever);
}

TEST(PaceTest, PlaysAtItsSpeedAndEnds) {
  Pace pace({.length = milliseconds{100}});
  pace.play(kBegin, 2);
  EXPECT_EQ(pace.position(kBegin + milliseconds{30}).at, milliseconds{60});
  EXPECT_EQ(pace.due({milliseconds{60}}), kBegin + milliseconds{30});
  EXPECT_FALSE(pace.is_over(kBegin + milliseconds{50}));
  EXPECT_TRUE(pace.is_over(kBegin + milliseconds{51}));
  EXPECT_EQ(pace.position(kBegin + milliseconds{500}).at, milliseconds{100});
}

TEST(PaceTest, BeginsAgainInALoop) {
  Pace pace({.length = milliseconds{9}, .loops = true});
  pace.play(kBegin, 1);
  EXPECT_EQ(pace.position(kBegin + milliseconds{9}).at, milliseconds{9});
  EXPECT_EQ(pace.position(kBegin + milliseconds{23}).round, 2u);
  EXPECT_EQ(pace.position(kBegin + milliseconds{23}).at, milliseconds{3});
  EXPECT_EQ(pace.due({milliseconds{3}, 2}), kBegin + milliseconds{23});
  EXPECT_FALSE(pace.is_over(kBegin + std::chrono::hours{5}));
}

TEST(PaceTest, PausesAndJumps) {
  Pace pace({.length = milliseconds{100}});
  pace.play(kBegin, 1);
  pace.pause(kBegin + milliseconds{10});
  EXPECT_EQ(pace.position(kBegin + milliseconds{90}).at, milliseconds{10});
  pace.seek(milliseconds{50});
  pace.play(kBegin + milliseconds{90}, 1);
  EXPECT_EQ(pace.position(kBegin + milliseconds{100}).at, milliseconds{60});
}

TEST(PaceTest, FollowsTheDeviceThatIsFarthestOn) {
  Pace pace({.length = milliseconds{9}, .stepped_count = 2});
  EXPECT_FALSE(pace.has_reached({}, kBegin));
  pace.step_to({milliseconds{4}});
  pace.step_to({milliseconds{2}});
  EXPECT_EQ(pace.position(kBegin).at, milliseconds{4});
  EXPECT_TRUE(pace.has_reached({milliseconds{4}}, kBegin));
  pace.end_steps(kBegin);
  EXPECT_FALSE(pace.is_over(kBegin));
  pace.end_steps(kBegin + milliseconds{1});
  EXPECT_FALSE(pace.is_over(kBegin));
  EXPECT_TRUE(pace.is_over(kBegin + milliseconds{1}));
  EXPECT_EQ(pace.position(kBegin).at, milliseconds{9});
}

}  // namespace
}  // namespace rtpm::replay
