#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <map>
#include <string>
#include <vector>

#include "rtpm/device_hid/open.hpp"
#include "rtpm/device_hid/profiles.hpp"

/// Devices that RTPM knows by their report descriptors only; see report_descriptors.txt.
namespace rtpm::device_hid {
namespace {

/// A paragraph of the file: its values by their keywords.
using Entry = std::map<std::string, std::string>;

std::vector<Entry> read_entries() {
  constexpr std::string_view kLeftOut = "left out";
  std::ifstream file(RTPM_REPORT_DESCRIPTORS);
  std::vector<Entry> entries(1);
  for (std::string line; std::getline(file, line);) {
    if (line.empty() && !entries.back().empty()) entries.emplace_back();
    if (line.empty() || line.starts_with('#')) continue;
    const std::size_t word_size = line.starts_with(kLeftOut) ? kLeftOut.size() : line.find(' ');
    const std::size_t value_begin = std::min(word_size, line.size()) + 1;
    entries.back()[line.substr(0, word_size)] +=
        value_begin < line.size() ? line.substr(value_begin) : "";
  }
  if (entries.back().empty()) entries.pop_back();
  return entries;
}

std::vector<std::byte> bytes_of(const std::string& hex) {
  std::vector<std::byte> bytes;
  for (std::size_t i = 0; i + 1 < hex.size(); i += 2)
    bytes.push_back(static_cast<std::byte>(std::stoi(hex.substr(i, 2), nullptr, 16)));
  return bytes;
}

/// The product does not belong to a maker that the driver knows.
Unit unit_of(const Entry& entry) {
  return {.vendor = 0x1209,
          .product = 1,
          .model = entry.at("name"),
          .node = "/dev/hidraw9",
          .report_descriptor = bytes_of(entry.at("bytes"))};
}

Unit unit_named(const std::string& name) {
  const auto entries = read_entries();
  const auto entry = std::ranges::find_if(
      entries, [&](const Entry& candidate) { return candidate.at("name") == name; });
  EXPECT_NE(entry, entries.end()) << name;
  return unit_of(*entry);
}

TEST(HidGamePads, AreReadAsTheirDescriptorsSay) {
  const auto entries = read_entries();
  ASSERT_GE(entries.size(), 24u);
  for (const Entry& entry : entries) {
    SCOPED_TRACE(entry.at("name"));
    const Unit unit = unit_of(entry);
    const auto kind = kind_of(unit);
    EXPECT_EQ(kind ? to_string(*kind) : "none", entry.at("kind"));
    if (!kind) {
      EXPECT_EQ(refusal_of(unit), entry.at("refusal"));
      continue;
    }
    const auto profile = make_profile(*kind, &unit, 0);
    std::string analogs;
    for (const driver::Analog& analog : profile->describe().analogs)
      analogs += (analogs.empty() ? "" : " ") + analog.name;
    std::string buttons;
    for (const std::string& button : profile->describe().buttons)
      buttons += (buttons.empty() ? "" : " ") + button.substr(button.find('_') + 1);
    EXPECT_EQ(analogs, entry.at("analogs"));
    EXPECT_EQ(buttons, entry.at("buttons"));
    EXPECT_EQ(profile->left_out(), entry.at("left out"));
  }
}

TEST(HidGamePads, GiveEachOfTwoControlsOfOneUsageItsValue) {
  const Unit unit = unit_named("TeensyDefault");
  GamePad teensy(&unit);
  State state;
  // Four bytes of buttons, the hat, then four axes and two sliders of 10 bits.
  std::vector<std::byte> report(12);
  report[10] = std::byte{0xc0};
  report[11] = std::byte{0xff};
  ASSERT_EQ(teensy.take(report, MonotonicTime{}, state), Verdict::kNew);
  EXPECT_EQ(state.analogs[6], 0) << "slider";
  EXPECT_EQ(state.analogs[7], 1) << "slider_2";
}

TEST(HidGamePads, KeepTheApplicationsOfOneDeviceApart) {
  const Unit unit = unit_named("KeyboardMousePad");
  GamePad pad(&unit);
  State state;
  ASSERT_EQ(pad.take(bytes_of("0207ff7f"), MonotonicTime{}, state), Verdict::kNew);
  EXPECT_EQ(state.buttons, 0u) << "of the mouse";
  EXPECT_EQ(state.analogs, decltype(state.analogs){});
  ASSERT_EQ(pad.take(bytes_of("0302ff00"), MonotonicTime{}, state), Verdict::kNew);
  EXPECT_EQ(state.buttons, 2u);
  EXPECT_EQ(state.analogs[0], 1);
}

TEST(HidProbe, ListsInputsThatAreLeftOut) {
  const auto found = found_among({unit_named("SwitchProBT"), unit_named("Mouse")});
  ASSERT_EQ(found.size(), 1u) << "a mouse is no pad";
  EXPECT_EQ(found[0].refusal, "");
  EXPECT_EQ(found[0].left_out, "1179 fields of the maker's own");
}

TEST(HidProbe, ListsPadsThatAreNotServedWithTheReason) {
  Unit cut = unit_named("SaitekGamepad");
  cut.report_descriptor.resize(70);
  const auto found = found_among({cut, unit_named("PadOfMakersPage")});
  ASSERT_EQ(found.size(), 2u);
  EXPECT_EQ(found[0].refusal, "its report descriptor is unreadable: a collection without an end");
  EXPECT_NE(found[1].refusal.find("neither axes nor buttons"), std::string::npos);
}

}  // namespace
}  // namespace rtpm::device_hid
