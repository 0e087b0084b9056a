#include "rtpm/base/priority.hpp"

#include <gtest/gtest.h>

namespace rtpm {
namespace {

TEST(Priority, RangesFrom0To32767) {
  EXPECT_EQ(Priority{}.value(), 0);
  EXPECT_EQ(Priority{32767}.value(), 32767);
  static_assert(Priority::is_valid(0) && Priority::is_valid(32767));
  static_assert(!Priority::is_valid(-1) && !Priority::is_valid(32768));
  static_assert(!Priority::is_valid(65536 + 5), "16 bits would wrap it to a valid one");
}

TEST(PriorityDeathTest, AbortsOnANumberOutsideTheRange) {
  // A volatile read, so that the compiler does not reject the value at compile time.
  volatile int too_high = 32768;
  volatile int too_low = -1;
  EXPECT_DEATH((void)Priority{too_high}, "a priority is 0 to 32767");
  EXPECT_DEATH((void)Priority{too_low}, "a priority is 0 to 32767");
}

TEST(Band, ContainsBothItsEnds) {
  const Band band{.low = 100, .high = 200};
  EXPECT_FALSE(band.contains(99));
  EXPECT_TRUE(band.contains(100));
  EXPECT_TRUE(band.contains(200));
  EXPECT_FALSE(band.contains(201));
  EXPECT_EQ(Band{}, (Band{.low = 0, .high = 32767})) << "by default every priority";
}

}  // namespace
}  // namespace rtpm
