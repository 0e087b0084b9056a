#include "preparsed_data.hpp"

#include <gtest/gtest.h>

#include <random>
#include <string>
#include <string_view>

#include "rtpm/device_hid/profiles.hpp"

/// Preparsed data of real devices, as Windows gave it, and the report descriptors of such devices.
namespace rtpm::device_hid {
namespace {

constexpr int kPad = 0x02;
constexpr int kButton = 0x04;
constexpr int kAbsolute = 0x08;
constexpr int kRange = 0x10;
constexpr int kAlias = 0x20;

struct Control {
  std::uint16_t page;
  std::uint8_t report;
  std::uint16_t byte;
  std::uint8_t bit;
  std::uint16_t size;
  std::uint16_t count;
  std::uint32_t flags;
  std::uint16_t collection;
  int kinds;
  std::uint16_t usage_low;
  std::uint16_t usage_high;
  std::int32_t low;
  std::int32_t high;
};
struct Collection {
  std::uint16_t usage;
  std::uint16_t page;
  std::uint16_t parent;
  std::uint8_t type;
};

template <class T>
void put(std::vector<std::byte>& bytes, std::size_t offset, T value) {
  store_le<T>(bytes.data() + offset, value);
}

std::vector<std::byte> preparsed(const std::vector<Control>& controls,
                                 const std::vector<Collection>& collections,
                                 std::uint16_t report_size) {
  constexpr std::size_t kControlSize = 104;
  constexpr std::string_view kMagic = "HidP KDR";
  const std::size_t offset = kControlSize * controls.size();
  std::vector<std::byte> bytes(kPreparsedHeaderSize + offset + 16 * collections.size());
  for (std::size_t i = 0; i < kMagic.size(); ++i)
    bytes[i] = static_cast<std::byte>(kMagic[i]);
  put(bytes, 18, static_cast<std::uint16_t>(controls.size()));
  put(bytes, 20, static_cast<std::uint16_t>(controls.size()));
  put(bytes, 22, report_size);
  put(bytes, 40, static_cast<std::uint16_t>(offset));
  put(bytes, 42, static_cast<std::uint16_t>(collections.size()));
  std::size_t at = kPreparsedHeaderSize;
  for (const Control& control : controls) {
    put(bytes, at, control.page);
    put(bytes, at + 2, control.report);
    put(bytes, at + 3, control.bit);
    put(bytes, at + 4, control.size);
    put(bytes, at + 6, control.count);
    put(bytes, at + 8, control.byte);
    put(bytes, at + 12, control.flags);
    put(bytes, at + 18, control.collection);
    put(bytes, at + 24, static_cast<std::uint8_t>(control.kinds));
    put(bytes, at + 60, control.usage_low);
    put(bytes, at + 62, control.usage_high);
    const std::size_t range = at + ((control.kinds & kButton) != 0 ? 76 : 80);
    put(bytes, range, static_cast<std::uint32_t>(control.low));
    put(bytes, range + 4, static_cast<std::uint32_t>(control.high));
    at += kControlSize;
  }
  for (const Collection& collection : collections) {
    put(bytes, at, collection.usage);
    put(bytes, at + 2, collection.page);
    put(bytes, at + 4, collection.parent);
    put(bytes, at + 12, collection.type);
    at += 16;
  }
  return bytes;
}

/// Logitech's joystick WingMan Force 3D. Windows keeps the usages of an item backwards.
std::vector<std::byte> wing_man() {
  return preparsed({{0x1, 0, 2, 0, 8, 1, 0x2, 2, kAbsolute, 0x31, 0x31, 0, 255},
                    {0x1, 0, 1, 0, 8, 1, 0x2, 2, kAbsolute, 0x30, 0x30, 0, 255},
                    {0xff00, 0, 3, 0, 4, 1, 0x2, 2, kAbsolute, 0x1, 0x1, 0, 15},
                    {0x1, 0, 3, 4, 4, 1, 0x42, 2, kAbsolute, 0x39, 0x39, 0, 7},
                    {0x1, 0, 4, 0, 8, 1, 0x2, 2, kAbsolute, 0x35, 0x35, 0, 255},
                    {0x9, 0, 5, 0, 1, 7, 0x2, 1, kAbsolute | kRange | kButton, 0x1, 0x7, 0, 0},
                    {0x1, 0, 6, 0, 8, 1, 0x2, 1, kAbsolute, 0x36, 0x36, 0, 255},
                    {0xff00, 0, 7, 0, 8, 1, 0x2, 1, kAbsolute, 0x1, 0x1, 0, 255}},
                   {{4, 1, 0, 1}, {0, 1, 0, 2}, {1, 1, 1, 0}, {0, 0xff00, 0, 2}}, 8);
}
constexpr std::string_view kWingManDescriptor =
    "05010904a1010900a1020901a10009300931150026ff00350046ff007508950281020600ff0901150025"
    "0f75049501810205010939150025073500463b0165147504950181420935150026ff00350046ff007508"
    "95018102c0050919012907150025017501950745006500810275019501810305010936150026ff003500"
    "46ff007508950181020600ff0901150026ff00750895018102c00900a1020902150026ff007508950891"
    "02c0c0";

/// An Xbox One pad behind Microsoft's driver, whose 65535 Windows takes for -1.
std::vector<std::byte> xbox_pad() {
  return preparsed({{0x1, 0, 3, 0, 16, 1, 0x2, 1, kAbsolute, 0x31, 0x31, 0, -1},
                    {0x1, 0, 1, 0, 16, 1, 0x2, 1, kAbsolute, 0x30, 0x30, 0, -1},
                    {0x1, 0, 7, 0, 16, 1, 0x2, 2, kAbsolute, 0x34, 0x34, 0, -1},
                    {0x1, 0, 5, 0, 16, 1, 0x2, 2, kAbsolute, 0x33, 0x33, 0, -1},
                    {0x1, 0, 9, 0, 16, 1, 0x2, 3, kAbsolute, 0x32, 0x32, 0, -1},
                    {0x9, 0, 11, 0, 1, 16, 0x2, 0, kAbsolute | kRange | kButton, 0x1, 0x10, 0, 0},
                    {0x1, 0, 13, 0, 4, 1, 0x42, 0, kAbsolute, 0x39, 0x39, 1, 8}},
                   {{5, 1, 0, 1}, {0, 1, 0, 0}, {0, 1, 0, 0}, {0, 1, 0, 0}}, 16);
}

std::vector<std::byte> from_hex(std::string_view hex) {
  std::vector<std::byte> bytes;
  for (std::size_t i = 0; i < hex.size(); i += 2)
    bytes.push_back(static_cast<std::byte>(std::stoi(std::string(hex.substr(i, 2)), nullptr, 16)));
  return bytes;
}

auto members_of(const Field& field) {
  return std::tuple(field.usage, field.application, field.report_id, field.bit_offset,
                    field.bit_size, field.logical_low, field.logical_high, field.is_relative,
                    field.has_null);
}

TEST(PreparsedData, HasTheFieldsOfTheDevicesOwnDescriptor) {
  const auto rebuilt = parse_report_descriptor(report_descriptor_from(wing_man()));
  const auto own = parse_report_descriptor(from_hex(kWingManDescriptor));
  ASSERT_TRUE(rebuilt && own);
  ASSERT_EQ(rebuilt->inputs.size(), own->inputs.size());
  for (std::size_t i = 0; i < own->inputs.size(); ++i)
    EXPECT_EQ(members_of(rebuilt->inputs[i]), members_of(own->inputs[i])) << "field " << i;
  EXPECT_EQ(rebuilt->input_sizes, own->input_sizes);
  EXPECT_FALSE(rebuilt->has_report_ids);
  ASSERT_EQ(rebuilt->unread.size(), 1u);
  EXPECT_EQ(rebuilt->unread[0].count, own->unread.at(0).count);
}

TEST(PreparsedData, OfAPadGivesItsChannels) {
  Unit unit;
  unit.report_descriptor = report_descriptor_from(xbox_pad());
  EXPECT_EQ(kind_of(unit), Kind::kGamePad);
  GamePad pad(&unit);
  std::string names;
  for (const auto& analog : pad.describe().analogs)
    names += analog.name + " ";
  EXPECT_EQ(names, "x y rx ry z hat_x hat_y ");
  EXPECT_EQ(pad.describe().buttons.size(), 16u);
  // x at its left end, the stick's y at its far end, the first button, the hat away from the user.
  std::vector<std::byte> report(15);
  report[2] = report[3] = std::byte{0xff};
  report[10] = std::byte{1};
  report[12] = std::byte{1};
  report[14] = std::byte{0xff};  // Padding, of which only the size is known.
  State state;
  EXPECT_EQ(pad.take(report, {}, state), Verdict::kNew);
  EXPECT_FLOAT_EQ(state.analogs[0], -1);
  EXPECT_FLOAT_EQ(state.analogs[1], 1);
  EXPECT_FLOAT_EQ(state.analogs[6], -1);
  EXPECT_EQ(state.buttons, 1u);
}

TEST(PreparsedData, KeepsNumbersGapsAndApplications) {
  // A wheel with a collection of commands in it, keys of an array with two ranges of usages, padding
  // and a second usage of the wheel.
  const auto data =
      preparsed({{0x1, 2, 4, 4, 12, 1, 0x2, 0, kAbsolute | kAlias, 0x37, 0x37, -2000, 2000},
                 {0x1, 2, 4, 4, 12, 1, 0x2, 0, kAbsolute, 0x30, 0x30, -2000, 2000},
                 {0xff00, 0xa1, 1, 0, 8, 24, 0x2, 1, kAbsolute, 0x1, 0x1, 0, 255},
                 {0x7, 2, 1, 0, 8, 2, 0x0, 0, kRange | kButton, 0x4, 0x10, 1, 13},
                 {0x7, 2, 1, 0, 8, 2, 0x0, 0, kRange | kButton, 0x20, 0x28, 14, 22},
                 {0x1, 2, 3, 0, 8, 1, 0x3, 0, kPad, 0, 0, 0, 0}},
                {{4, 1, 0, 1}, {0x7f, 0xff00, 0, 1}}, 25);
  const auto rebuilt = parse_report_descriptor(report_descriptor_from(data));
  ASSERT_TRUE(rebuilt) << rebuilt.error();
  EXPECT_TRUE(rebuilt->has_report_ids);
  EXPECT_EQ(rebuilt->input_sizes[2], 6) << "the padding of a report's end is not known";
  EXPECT_EQ(rebuilt->input_sizes[0xa1], 25);
  ASSERT_EQ(rebuilt->inputs.size(), 1u);
  const Field& wheel = rebuilt->inputs[0];
  EXPECT_EQ(members_of(wheel),
            std::tuple(0x0001'0030u, 0x0001'0004u, 2, 8u + 24 + 4, 12, -2000, 2000, false, false));
  ASSERT_EQ(rebuilt->unread.size(), 2u);
  EXPECT_EQ(rebuilt->unread[0].count, 2u) << "an array of two";
  EXPECT_EQ(rebuilt->unread[1].application, 0xff00'007fu);
}

TEST(PreparsedData, IsRefusedInAnotherLayout) {
  const std::vector<std::byte> data = wing_man();
  for (std::size_t size = 0; size < data.size(); ++size)
    EXPECT_TRUE(report_descriptor_from(ConstBytes(data).first(size)).empty());
  auto other = data;
  other[7] = std::byte{'S'};
  EXPECT_TRUE(report_descriptor_from(other).empty());
  other = data;
  put(other, 20, std::uint16_t{1000});
  EXPECT_TRUE(report_descriptor_from(other).empty()) << "controls behind the end";
}

TEST(PreparsedData, IsReadWithAnyFault) {
  std::mt19937 random(1);
  for (int i = 0; i < 3000; ++i) {
    auto data = i % 2 == 0 ? wing_man() : xbox_pad();
    for (int fault = 0; fault < 4; ++fault)
      data[8 + random() % (data.size() - 8)] = static_cast<std::byte>(random());
    // It may be refused, but never is more than the parser takes.
    const auto parsed = parse_report_descriptor(report_descriptor_from(data));
    EXPECT_TRUE(!parsed || parsed->inputs.size() <= kFieldCountMax);
  }
}

}  // namespace
}  // namespace rtpm::device_hid
