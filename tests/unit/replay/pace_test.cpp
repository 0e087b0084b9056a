#include "rtpm/replay/pace.hpp"

#include <gtest/gtest.h>

#include "rtpm/base/time.hpp"

namespace rtpm::replay {
namespace {

using std::chrono::milliseconds;

constexpr MonotonicTime kBegin = time_from_ns(5'000'000'000);

TEST(PaceTest, StandsAtTheBeginBeforeItStarts) {
  const Pace pace(milliseconds{100}, 1, false);
  EXPECT_EQ(pace.position(kBegin).at, Duration{0});
  EXPECT_FALSE(pace.position(kBegin).is_over);
}

TEST(PaceTest, GoesAsFastAsItShallAndEnds) {
  Pace pace(milliseconds{100}, 2, false);
  pace.start(kBegin);
  EXPECT_EQ(pace.position(kBegin + milliseconds{30}).at, milliseconds{60});
  EXPECT_FALSE(pace.position(kBegin + milliseconds{50}).is_over);
  EXPECT_TRUE(pace.position(kBegin + milliseconds{51}).is_over);
  EXPECT_EQ(pace.position(kBegin + milliseconds{500}).at, milliseconds{100});
}

TEST(PaceTest, BeginsAgainInALoop) {
  Pace pace(milliseconds{9}, 1, true);
  pace.start(kBegin);
  EXPECT_EQ(pace.position(kBegin + milliseconds{9}).at, milliseconds{9});
  EXPECT_EQ(pace.position(kBegin + milliseconds{23}).round, 2u);
  EXPECT_EQ(pace.position(kBegin + milliseconds{23}).at, milliseconds{3});
  EXPECT_FALSE(pace.position(kBegin + std::chrono::hours{5}).is_over);
}

}  // namespace
}  // namespace rtpm::replay
