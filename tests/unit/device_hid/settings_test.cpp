#include "rtpm/device_hid/settings.hpp"

#include <gtest/gtest.h>

#include "scripted_hid.hpp"

namespace rtpm::device_hid {
namespace {

TEST(HidSettings, AreRead) {
  const auto settings =
      read_settings("kind=openffboard serial=AB12 node=/dev/hidraw3 torque_newton_metre=2.5");
  ASSERT_TRUE(settings);
  EXPECT_EQ(settings->kind, Kind::kOpenFfBoard);
  EXPECT_EQ(settings->serial, "AB12");
  EXPECT_EQ(settings->node, "/dev/hidraw3");
  EXPECT_EQ(settings->torque_newton_metre, 2.5);
  EXPECT_TRUE(read_settings(""));
}

TEST(HidSettings, AreRefusedWithTheReason) {
  EXPECT_NE(read_settings("kind=mouse").error().text().find("spacemouse"), std::string::npos);
  for (const char* words :
       {"gamepad", "kind=", "speed=3", "torque_newton_metre=much", "torque_newton_metre=-1",
        "torque_newton_metre=nan", "torque_newton_metre=1e9", "serial=1 serial=2"}) {
    EXPECT_FALSE(read_settings(words)) << words;
  }
}

class HidChoice : public testing::Test {
 protected:
  HidChoice() {
    system_.plug(test::make_model(1), "A", "usb-1/input0", "/dev/hidraw0");
    system_.plug(test::make_model(2), "B", "usb-2/input0", "/dev/hidraw1");
    system_.plug(test::make_model(1), "A", "usb-3/input0", "/dev/hidraw2");
  }
  std::string node(const Settings& settings, const Identity* known = nullptr) {
    units_ = system_.units();
    const auto unit = choose(units_, settings, known);
    if (!unit) return "refused";
    return *unit == nullptr ? "none" : (*unit)->node;
  }
  test::ScriptedHidSystem system_;
  std::vector<Unit> units_{};
};

TEST_F(HidChoice, TakesTheOneThatFits) {
  EXPECT_EQ(node({.serial = "B"}), "/dev/hidraw1");
  EXPECT_EQ(node({.kind = Kind::kDualShock4}), "/dev/hidraw1");
  EXPECT_EQ(node({.node = "/dev/hidraw2"}), "/dev/hidraw2");
  EXPECT_EQ(node({.kind = Kind::kGamePad, .serial = "B"}), "/dev/hidraw1") << "as a plain game pad";
  EXPECT_EQ(node({.kind = Kind::kSpaceMouse}), "none");
  EXPECT_EQ(node({.serial = "C"}), "none");
}

TEST_F(HidChoice, RefusesTwoUnitsOfOneSerialNumber) {
  const auto refused = choose(system_.units(), {.serial = "A"}, nullptr);
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().text().find("/dev/hidraw2"), std::string::npos);
  EXPECT_NE(refused.error().text().find("node="), std::string::npos);
  EXPECT_EQ(node({}), "refused");
}

TEST_F(HidChoice, FindsAKnownUnitAgain) {
  const Identity pad{"B", "usb-2/input0", "/dev/hidraw1"};
  system_.plugged[1].unit.node = "/dev/hidraw7";
  system_.plugged[1].unit.port = "usb-9/input0";
  EXPECT_EQ(node({.node = "/dev/hidraw1"}, &pad), "/dev/hidraw7") << "at another node and port";
  const Identity twin{"A", "usb-3/input0", "/dev/hidraw2"};
  system_.plugged[2].unit.node = "/dev/hidraw8";
  EXPECT_EQ(node({.node = "/dev/hidraw2"}, &twin), "/dev/hidraw8") << "by its port";
  const Identity stranger{"Z", "usb-1/input0", "/dev/hidraw0"};
  EXPECT_EQ(node({}, &stranger), "none") << "another unit at its port is not it";
}

TEST_F(HidChoice, FindsAUnitWithoutSerialNumberByItsPort) {
  for (auto& plugged : system_.plugged)
    plugged.unit.serial.clear();
  const Identity known{"", "usb-3/input0", "/dev/hidraw0"};
  EXPECT_EQ(node({}, &known), "/dev/hidraw2");
}

TEST(HidKind, IsThatOfTheProductOrTheDescriptor) {
  for (std::size_t i = 0; i < kKinds.size(); ++i) {
    const auto units = test::system_with(test::make_model(i))->units();
    EXPECT_EQ(kind_of(units[0]), kKinds[i]);
  }
  Unit mouse{.vendor = 1, .product = 2};
  for (const int byte : {0x05, 0x01, 0x09, 0x02, 0xa1, 0x01, 0x25, 0x7f, 0x75, 0x08, 0x95, 0x01,
                         0x09, 0x30, 0x81, 0x06, 0xc0}) {
    mouse.report_descriptor.push_back(static_cast<std::byte>(byte));
  }
  EXPECT_EQ(kind_of(mouse), std::nullopt);
  mouse.vendor = 0x256f;
  mouse.product = 0xc652;
  EXPECT_EQ(kind_of(mouse), std::nullopt) << "the mouse interface of a receiver";
}

}  // namespace
}  // namespace rtpm::device_hid
