#include "cli/pattern.hpp"

#include <gtest/gtest.h>

namespace rtpm::tool {
namespace {

TEST(Pattern, IsForTheWholeText) {
  EXPECT_TRUE(matches("lab/arm0", "lab/arm0"));
  EXPECT_FALSE(matches("lab/arm", "lab/arm0"));
  EXPECT_FALSE(matches("lab/arm00", "lab/arm0"));
  EXPECT_TRUE(matches("", ""));
  EXPECT_FALSE(matches("", "a"));
}

TEST(Pattern, TakesAnyTextForAStar) {
  EXPECT_TRUE(matches("*", ""));
  EXPECT_TRUE(matches("lab/*", "lab/cell/arm0"));
  EXPECT_TRUE(matches("*arm*0", "lab/arm1/arm20"));
  EXPECT_FALSE(matches("*arm*0", "lab/arm1/arm21"));
  EXPECT_TRUE(matches("a**b", "ab"));
}

TEST(Pattern, TakesOneCharacterOfASet) {
  EXPECT_TRUE(matches("arm?", "arm0"));
  EXPECT_FALSE(matches("arm?", "arm"));
  EXPECT_TRUE(matches("arm[0-2x]", "arm1"));
  EXPECT_TRUE(matches("arm[0-2x]", "armx"));
  EXPECT_FALSE(matches("arm[0-2x]", "arm3"));
  EXPECT_TRUE(matches("arm[!0-2]", "arm3"));
  EXPECT_FALSE(matches("arm[!0-2]", "arm0"));
  EXPECT_TRUE(matches("a[]b]c", "a]c"));
  EXPECT_FALSE(matches("a[!]b]c", "a]c"));
  EXPECT_TRUE(matches("arm[0", "arm[0"));
}

TEST(Pattern, TakesWhatABackslashMarksLiterally) {
  EXPECT_TRUE(matches("arm\\*", "arm*"));
  EXPECT_FALSE(matches("arm\\*", "arm0"));
  EXPECT_TRUE(matches("a\\", "a\\"));
}

}  // namespace
}  // namespace rtpm::tool
