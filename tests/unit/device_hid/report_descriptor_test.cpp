#include "rtpm/device_hid/report_descriptor.hpp"

#include <gtest/gtest.h>

#include <initializer_list>
#include <vector>

namespace rtpm::device_hid {
namespace {

std::vector<std::byte> bytes(std::initializer_list<int> values) {
  std::vector<std::byte> result;
  for (const int value : values)
    result.push_back(static_cast<std::byte>(value));
  return result;
}

/// The beginning of a SpaceNavigator's descriptor: two collections of axes, then buttons.
std::vector<std::byte> navigator() {
  return bytes({0x05, 0x01, 0x09, 0x08, 0xA1, 0x01, 0xA1, 0x00, 0x85, 0x01, 0x16, 0xA2, 0xFE,
                0x26, 0x5E, 0x01, 0x09, 0x30, 0x09, 0x31, 0x09, 0x32, 0x75, 0x10, 0x95, 0x03,
                0x81, 0x06, 0xC0, 0xA1, 0x00, 0x85, 0x02, 0x09, 0x33, 0x09, 0x34, 0x09, 0x35,
                0x75, 0x10, 0x95, 0x03, 0x81, 0x06, 0xC0, 0xA1, 0x02, 0x85, 0x03, 0x05, 0x01,
                0x05, 0x09, 0x19, 0x01, 0x29, 0x02, 0x15, 0x00, 0x25, 0x01, 0x75, 0x01, 0x95,
                0x02, 0x81, 0x02, 0x95, 0x0E, 0x81, 0x03, 0xC0, 0xC0});
}

TEST(HidReportDescriptor, ReadsASpaceNavigator) {
  const auto descriptor = parse_report_descriptor(navigator());
  ASSERT_TRUE(descriptor) << descriptor.error();
  ASSERT_EQ(descriptor->inputs.size(), 8u);
  EXPECT_TRUE(descriptor->has_report_ids);
  EXPECT_EQ(descriptor->input_sizes[1], 7);
  EXPECT_EQ(descriptor->input_sizes[2], 7);
  EXPECT_EQ(descriptor->input_sizes[3], 3);
  EXPECT_EQ(descriptor->input_sizes[4], 0);
  const Field& turn = descriptor->inputs[4];
  EXPECT_EQ(turn.usage, kDesktopPage + 0x34);
  EXPECT_EQ(turn.logical_low, -350) << "inherited from the first report";
  EXPECT_EQ(turn.logical_high, 350);
  EXPECT_TRUE(turn.is_relative) << "as it says, though its values are absolute";
  EXPECT_EQ(turn.application, kDesktopPage + 8);
  EXPECT_EQ(value_of(turn, bytes({2, 0, 0, 0xe2, 0xff, 0, 0})), -30);
  EXPECT_EQ(value_of(turn, bytes({1, 0, 0, 0xe2, 0xff, 0, 0})), std::nullopt) << "another report";
  EXPECT_EQ(value_of(turn, bytes({2, 0, 0, 0xe2})), std::nullopt) << "too short";
  const Field& button = descriptor->inputs[7];
  EXPECT_EQ(button.usage, kButtonPage + 2) << "of the last usage page";
  EXPECT_EQ(value_of(button, bytes({3, 2, 0})), 1);
  EXPECT_EQ(value_of(button, bytes({3, 1, 0})), 0);
}

TEST(HidReportDescriptor, ReadsUnsignedRangesAndUnnumberedReports) {
  // X and Y of 8 bits up to 255, which reads as -1; a hat of 4 bits with a null state.
  const auto descriptor = parse_report_descriptor(
      bytes({0x05, 0x01, 0x09, 0x05, 0xA1, 0x01, 0x15, 0x00, 0x25, 0xFF, 0x75, 0x08, 0x95,
             0x02, 0x09, 0x30, 0x09, 0x31, 0x81, 0x02, 0x25, 0x07, 0x75, 0x04, 0x95, 0x01,
             0x09, 0x39, 0x81, 0x42, 0x75, 0x04, 0x95, 0x01, 0x81, 0x03, 0xC0}));
  ASSERT_TRUE(descriptor) << descriptor.error();
  ASSERT_EQ(descriptor->inputs.size(), 3u);
  EXPECT_EQ(descriptor->inputs[1].logical_high, 255);
  EXPECT_EQ(value_of(descriptor->inputs[1], bytes({1, 200, 0xf3})), 200);
  EXPECT_TRUE(descriptor->inputs[2].has_null);
  EXPECT_EQ(value_of(descriptor->inputs[2], bytes({1, 200, 0xf3})), 3);
  EXPECT_EQ(descriptor->input_sizes[0], 3);
}

TEST(HidReportDescriptor, RestoresPushedStates) {
  const auto descriptor =
      parse_report_descriptor(bytes({0x05, 0x01, 0x75, 0x08, 0x95, 0x01, 0x25, 0x7f, 0xA4, 0x75,
                                     0x10, 0xB4, 0x09, 0x30, 0x81, 0x02}));
  ASSERT_TRUE(descriptor) << descriptor.error();
  ASSERT_EQ(descriptor->inputs.size(), 1u);
  EXPECT_EQ(descriptor->inputs[0].bit_size, 8);
}

TEST(HidReportDescriptor, RefusesInvalidDescriptors) {
  const std::vector<std::vector<std::byte>> wrong{
      bytes({0x26, 0x01}),                                // Cut off.
      bytes({0xC0}),                                      // An end without a beginning.
      bytes({0xA1, 0x01}),                                // A beginning without an end.
      bytes({0xB4}),                                      // A pop without a push.
      bytes({0x85, 0x00}),                                // Report number 0.
      bytes({0xFE, 0x02, 0x00, 0x00, 0x00}),              // A long item.
      bytes({0xA9, 0x01}),                                // A delimiter without an end.
      bytes({0xA9, 0x00}),                                // A delimiter's end without a beginning.
      bytes({0x76, 0x01, 0x01}),                          // A field of 257 bits.
      bytes({0x96, 0x01, 0x30}),                          // 12 289 fields.
      bytes({0x75, 0xff, 0x96, 0x00, 0x30, 0x81, 0x02}),  // A report of 381 kB.
      std::vector<std::byte>(kDescriptorSizeMax + 1),     // Too long.
  };
  for (std::size_t i = 0; i < wrong.size(); ++i)
    EXPECT_FALSE(parse_report_descriptor(wrong[i])) << i;
}

/// A maker's block of bytes must not keep a pad out.
TEST(HidReportDescriptor, CountsSkippedItems) {
  const auto descriptor = parse_report_descriptor(bytes(
      {0x06, 0x00, 0xff, 0x09, 0x01, 0x75, 0x08, 0x96, 0x00, 0x08, 0x81, 0x02,  // 2 048 bytes,
       0x05, 0x01, 0x09, 0x30, 0x95, 0x02, 0x81, 0x00,                          // an array,
       0x09, 0x30, 0x75, 0x28, 0x95, 0x01, 0x81, 0x02,                          // 40 bits,
       0x81, 0x02,                                                              // padding,
       0x05, 0x09, 0x19, 0x01, 0x2A, 0x01, 0x02, 0x75, 0x01, 0x96, 0x01, 0x02, 0x81, 0x02}));
  ASSERT_TRUE(descriptor) << descriptor.error();
  EXPECT_EQ(descriptor->inputs.size(), kFieldCountMax) << "of 513 buttons";
  ASSERT_EQ(descriptor->unread.size(), 3u);
  EXPECT_EQ(descriptor->unread[0].page, 0xff00'0000u);
  EXPECT_EQ(descriptor->unread[0].count, 2048u);
  EXPECT_EQ(descriptor->unread[1].count, 3u);
  EXPECT_EQ(descriptor->unread[2].count, 1u);
  EXPECT_EQ(descriptor->inputs.front().bit_offset, 2048u * 8 + 16 + 40 + 40);
}

TEST(HidReportDescriptor, IsRefusedOrWholeWhereverItIsCut) {
  const auto whole = navigator();
  for (std::size_t size = 0; size < whole.size(); ++size) {
    const auto cut = parse_report_descriptor(ConstBytes(whole).first(size));
    EXPECT_EQ(cut.has_value(), size == 0 || size == 2 || size == 4) << size;
  }
}

}  // namespace
}  // namespace rtpm::device_hid
