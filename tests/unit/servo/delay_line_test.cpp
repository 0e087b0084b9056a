#include "delay_line.hpp"

#include <gtest/gtest.h>

namespace rtpm::servo {
namespace {

using std::chrono::milliseconds;

constexpr MonotonicTime kBegin{std::chrono::seconds{1}};

TEST(DelayLine, GivesEachValueBackAfterTheDelay) {
  DelayLine<int, 8> line(milliseconds{3});
  for (int i = 0; i < 100; ++i)
    EXPECT_EQ(line.pass(kBegin + milliseconds{i}, 1000 + i), i < 3 ? 0 : 1000 + i - 3);
}

TEST(DelayLine, SkipsOvertakenValues) {
  DelayLine<int, 8> line(milliseconds{3});
  EXPECT_EQ(line.pass(kBegin, 1), 0);
  EXPECT_EQ(line.pass(kBegin + milliseconds{1}, 2), 0);
  EXPECT_EQ(line.pass(kBegin + milliseconds{5}, 3), 2) << "the newest of those that are old enough";
}

TEST(DelayLine, LosesTheOldestOfTooMany) {
  DelayLine<int, 4> line(milliseconds{10});
  for (int i = 0; i < 8; ++i)
    EXPECT_EQ(line.pass(kBegin + milliseconds{i}, 1 + i), 0);
  EXPECT_EQ(line.pass(kBegin + milliseconds{15}, 99), 6);
}

}  // namespace
}  // namespace rtpm::servo
