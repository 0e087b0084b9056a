#include "rtpm/replay/pace.hpp"

#include <gtest/gtest.h>

#include "rtpm/base/time.hpp"

namespace rtpm::replay {
namespace {

using std::chrono::milliseconds;

constexpr MonotonicTime kBegin = time_from_ns(5'000'000'000);

TEST(PaceTest, PlaysAtItsSpeedAndEnds) {
  Pace pace({.length = milliseconds{100}});
  pace.play(kBegin, 2);
  EXPECT_EQ(pace.position(kBegin + milliseconds{30}).at, milliseconds{60});
  EXPECT_EQ(pace.due({milliseconds{60}}), kBegin + milliseconds{30});
  EXPECT_FALSE(pace.is_over(kBegin + milliseconds{50}));
  EXPECT_TRUE(pace.is_over(kBegin + milliseconds{51}));
  EXPECT_EQ(pace.position(kBegin + milliseconds{500}).at, milliseconds{100});
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
