#include "rtpm/device_io/found_device.hpp"

#include <gtest/gtest.h>

namespace rtpm::test {
namespace {

TEST(FoundDevice, SaysWhichRightIsMissing) {
  EXPECT_EQ(device_io::missing_right("/dev/null"), "");
  EXPECT_EQ(device_io::missing_right("/dev/no such node"), "/dev/no such node, which is gone");
}

TEST(FoundDevice, HasARuleForItsNode) {
  EXPECT_EQ(device_io::udev_rule("usb", 0x0403, 0xcb48),
            R"(SUBSYSTEM=="usb", ATTR{idVendor}=="0403", ATTR{idProduct}=="cb48", TAG+="uaccess")");
  EXPECT_EQ(
      device_io::udev_rule("hidraw", 0x46d, 0xc626),
      R"(SUBSYSTEM=="hidraw", ATTRS{idVendor}=="046d", ATTRS{idProduct}=="c626", TAG+="uaccess")");
}

TEST(FoundDevice, SaysWhereTheRuleGoes) {
  const std::string remedy = device_io::rule_remedy("RULE");
  EXPECT_NE(remedy.find("RULE"), std::string::npos);
  EXPECT_NE(remedy.find("/etc/udev/rules.d/"), std::string::npos);
}

}  // namespace
}  // namespace rtpm::test
