#include "rtpm/device_evdev/settings.hpp"

#include <gtest/gtest.h>

#include <numbers>

namespace rtpm::device_evdev {
namespace {

TEST(EvdevSettings, AreRead) {
  const auto settings = read_settings(
      "serial=A1 path=usb-0:2 grab=yes gain=0.5 range_degree=180 torque_newton_metre=2.5 "
      "reverse=yes counts_per_inch=254 counts_per_turn=96 name=A Racing Wheel");
  ASSERT_TRUE(settings);
  EXPECT_EQ(settings->serial, "A1");
  EXPECT_EQ(settings->path, "usb-0:2");
  EXPECT_EQ(settings->name, "A Racing Wheel");
  EXPECT_TRUE(settings->is_grabbed);
  EXPECT_EQ(settings->gain, 0.5);
  EXPECT_NEAR(settings->scales.wheel_range_rad, std::numbers::pi, 1e-12);
  EXPECT_EQ(settings->scales.effort_newton_metre_max, 2.5);
  EXPECT_NEAR(settings->scales.counts_per_m, 10'000, 1e-6);
  EXPECT_EQ(settings->scales.counts_per_turn, 96);
  EXPECT_TRUE(settings->scales.is_reversed);
  EXPECT_FALSE(read_settings("")->names_one());
}

TEST(EvdevSettings, AreRefusedWithTheReason) {
  for (const char* words :
       {"wheel", "serial=", "gain=2", "gain=nan", "gain=1x", "grab=perhaps", "range_degree=0",
        "torque_newton_metre=1e9", "torque_newton_metre=inf", "node=a node=b", "speed=3"}) {
    const auto settings = read_settings(words);
    ASSERT_FALSE(settings) << words;
    EXPECT_FALSE(settings.error().remedy.empty()) << words;
  }
}

Unit unit(const char* node, const char* name, const char* serial, const char* path,
          bool is_joystick = true) {
  return {.node = node, .name = name, .serial = serial, .path = path, .is_joystick = is_joystick};
}

TEST(EvdevChoice, TakesTheOnlyJoystick) {
  const std::vector<Unit> units{unit("event1", "Keyboard", "", "a", false),
                                unit("event2", "Pad", "A1", "b")};
  const auto chosen = choose(units, {}, std::nullopt);
  ASSERT_TRUE(chosen);
  EXPECT_EQ(chosen->node, "event2");
  EXPECT_FALSE(choose({}, {}, std::nullopt));
}

TEST(EvdevChoice, SelectsByEachOption) {
  const std::vector<Unit> units{unit("event1", "Keyboard", "", "a", false),
                                unit("event2", "Pad", "A1", "b"), unit("event3", "Pad", "A2", "c")};
  EXPECT_EQ(choose(units, {.serial = "A2"}, std::nullopt)->node, "event3");
  EXPECT_EQ(choose(units, {.path = "b"}, std::nullopt)->node, "event2");
  EXPECT_EQ(choose(units, {.node = "event3"}, std::nullopt)->node, "event3");
  EXPECT_EQ(choose(units, {.name = "Keyboard"}, std::nullopt)->node, "event1");
  const auto none = choose(units, {.serial = "A3"}, std::nullopt);
  ASSERT_FALSE(none);
  EXPECT_NE(none.error().text().find("serial=A3"), std::string::npos);
}

TEST(EvdevChoice, TakesThePadAndNotItsMotionSensors) {
  const std::vector<Unit> units{unit("event2", "Pad", "A1", "b"),
                                unit("event3", "Pad Motion Sensors", "A1", "b", false)};
  EXPECT_EQ(choose(units, {.serial = "A1"}, std::nullopt)->node, "event2");
  EXPECT_EQ(choose(units, {.name = "Pad Motion Sensors"}, std::nullopt)->node, "event3");
}

TEST(EvdevChoice, RefusesTwoThatAreAlike) {
  const std::vector<Unit> units{unit("event2", "Pad", "A1", "b"), unit("event3", "Pad", "A1", "c")};
  for (const Settings& settings : {Settings{}, Settings{.serial = "A1"}, Settings{.name = "Pad"}}) {
    const auto refused = choose(units, settings, std::nullopt);
    ASSERT_FALSE(refused);
    EXPECT_NE(refused.error().text().find("path="), std::string::npos);
    EXPECT_NE(refused.error().text().find("event3"), std::string::npos);
  }
  EXPECT_EQ(choose(units, {.serial = "A1", .path = "c"}, std::nullopt)->node, "event3");
}

TEST(EvdevChoice, FindsTheSameUnitAgainAtAnotherNode) {
  const Unit known = unit("event2", "Pad", "A1", "b");
  const std::vector<Unit> units{unit("event2", "Pad", "A2", "b"), unit("event7", "Pad", "A1", "c")};
  EXPECT_EQ(choose(units, {.node = "event2"}, known)->node, "event7") << "by its serial number";
  EXPECT_EQ(choose(units, {.path = "b"}, known)->node, "event2") << "by the port that was given";
  const Unit anonymous = unit("event2", "Pad", "", "b");
  const std::vector<Unit> others{unit("event2", "Pad", "", "d"), unit("event7", "Pad", "", "b")};
  EXPECT_EQ(choose(others, {}, anonymous)->node, "event7") << "without one by its port";
}

TEST(EvdevChoice, RefusesASecondUnitOfTheSerialNumberAfterAReplug) {
  const Unit known = unit("event2", "Pad", "A1", "b");
  const std::vector<Unit> units{unit("event3", "Pad", "A1", "b"), unit("event7", "Pad", "A1", "c")};
  EXPECT_FALSE(choose(units, {.serial = "A1"}, known));
  EXPECT_EQ(choose(units, {.serial = "A1", .path = "b"}, known)->node, "event3");
}

}  // namespace
}  // namespace rtpm::device_evdev
