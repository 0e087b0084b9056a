#include "rtpm/base/assert.hpp"

#include <gtest/gtest.h>

namespace rtpm {
namespace {

TEST(Assert, EvaluatesItsConditionOnce) {
  int evaluation_count = 0;
  RTPM_ASSERT(++evaluation_count == 1, "the condition is evaluated once");
  EXPECT_EQ(evaluation_count, 1);
}

TEST(AssertDeathTest, NamesTheBrokenPromiseAndItsLocation) {
  // GoogleTest's regular expressions have no classes on Windows.
  EXPECT_DEATH(RTPM_ASSERT(1 + 1 == 3, "sums add up"),
               "rtpm: bug: sums add up \\(1 \\+ 1 == 3 does not hold\\) at .*assert_test\\.cpp:.");
}

}  // namespace
}  // namespace rtpm
