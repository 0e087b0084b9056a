#include <gtest/gtest.h>

#include <array>
#include <type_traits>

#include "rtpm/driver/driver.hpp"

namespace rtpm::driver {
namespace {

TEST(Faults, AreASetOfBits) {
  Faults faults;
  EXPECT_TRUE(faults.empty());
  faults.set(Fault::kCommandLost);
  faults.set(Fault::kSoftStart);
  EXPECT_TRUE(faults.has(Fault::kCommandLost));
  EXPECT_FALSE(faults.has(Fault::kDeviceGone));
  EXPECT_EQ(faults.bits(), (1u << 9) | (1u << 12));
  Faults more{static_cast<std::uint32_t>(Fault::kDeviceGone)};
  more.set(faults);
  EXPECT_TRUE(more.has(Fault::kDeviceGone) && more.has(Fault::kSoftStart));
}

TEST(Faults, AreReadByPeople) {
  EXPECT_EQ(to_text(Faults{}), "none");
  Faults faults;
  faults.set(Fault::kSoftStart);
  faults.set(Fault::kCommandLost);
  EXPECT_EQ(to_text(faults), "command lost, soft start");
  EXPECT_EQ(to_text(Faults{1u << 31}), "none") << "a bit of a later version is no word of ours";
}

TEST(Words, NameEveryEnumerator) {
  for (std::uint8_t i = 0; i < kLifecycleCount; ++i) {
    EXPECT_NE(to_string(static_cast<Lifecycle>(i)), "unknown");
  }
  for (std::uint8_t i = 0; i < kDeviceClassCount; ++i) {
    EXPECT_NE(to_string(static_cast<DeviceClass>(i)), "unknown");
  }
  for (std::uint8_t i = 0; i < kCommandModeCount; ++i) {
    EXPECT_NE(to_string(static_cast<CommandMode>(i)), "unknown");
  }
  EXPECT_EQ(to_string(static_cast<Lifecycle>(kLifecycleCount)), "unknown");
  EXPECT_EQ(to_string(ExchangeStatus::kCorrupt), "corrupt");
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
