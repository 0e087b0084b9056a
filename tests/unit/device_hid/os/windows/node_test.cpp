#include "node.hpp"

#include <gtest/gtest.h>

#include "rtpm/device_hid/profiles.hpp"
#include "rtpm/device_io/found_device.hpp"

/// The part of Windows itself, as far as no device is needed.
namespace rtpm::device_hid {
namespace {

const char* const kMissing = R"(\\?\hid#vid_1209&pid_ffb0#7&1&0&0000#{00000000})";

TEST(Node, IsGone) {
  EXPECT_EQ(device_io::missing_right(kMissing), std::string(kMissing) + ", which is gone");
  EXPECT_TRUE(report_descriptor_of(kMissing).empty());
  const auto opened = make_hid_system()->open({.node = kMissing});
  ASSERT_FALSE(opened);
  EXPECT_NE(opened.error().text().find("which is gone"), std::string::npos);
}

TEST(Node, SaysWhichProgramsMayHoldIt) {
  EXPECT_EQ(device_io::udev_rule("hidraw", 0x46d, 0xc626), "");
  for (const char* program : {"3DxWare", "Steam", "DS4Windows", "HidHide"})
    EXPECT_NE(device_io::rule_remedy("").find(program), std::string::npos);
}

TEST(Node, CutsReportsToTheirOwnSize) {
  Unit unit{.node = kMissing};
  constexpr std::array kNumbered{0x85, 0x01, 0x75, 0x08, 0x95, 0x06, 0x81,
                                 0x01, 0x85, 0x03, 0x95, 0x02, 0x81, 0x01};
  for (const int byte : kNumbered)
    unit.report_descriptor.push_back(static_cast<std::byte>(byte));
  const ReportSizes numbered = report_sizes_of(unit);
  EXPECT_EQ(numbered.inputs[1], 7);
  EXPECT_EQ(numbered.inputs[3], 3);
  EXPECT_EQ(numbered.inputs[2], 0);
  unit.report_descriptor.erase(unit.report_descriptor.begin(), unit.report_descriptor.begin() + 2);
  unit.report_descriptor.resize(6);
  const ReportSizes plain = report_sizes_of(unit);
  for (const std::uint16_t size : plain.inputs)
    EXPECT_EQ(size, 6) << "without numbers, the first byte may be any";
}

TEST(Node, IsListedWithItsReports) {
  for (const Unit& unit : make_hid_system()->units()) {
    EXPECT_FALSE(unit.node.empty());
    EXPECT_TRUE(parse_report_descriptor(unit.report_descriptor)) << unit.node;
  }
}

}  // namespace
}  // namespace rtpm::device_hid
