#include <gtest/gtest.h>

#include <array>
#include <type_traits>

#include "rtpm/driver/driver.hpp"

namespace rtpm::driver {
namespace {

TEST(Faults, AreReadByPeople) {
  EXPECT_EQ(to_text(Faults{}), "none");
  Faults faults;
  faults.set(Fault::kSoftStart);
  faults.set(Fault::kCommandLost);
  EXPECT_EQ(to_text(faults), "command lost, soft start");
  EXPECT_EQ(to_text(Faults{1u << 31}), "none") << "a bit of a later version is no word of ours";
}

TEST(Values, CanBeCopiedByBytes) {
  EXPECT_TRUE(std::is_trivially_copyable_v<Sample>);
  EXPECT_TRUE(std::is_trivially_copyable_v<Command>);
  const Sample sample;
  EXPECT_EQ(sample.pose.orientation, (Quaternion{0, 0, 0, 1})) << "the default turns nothing";
  EXPECT_EQ(Command{}.mode, CommandMode::kOff) << "the default commands no force";
}

}  // namespace
}  // namespace rtpm::driver
