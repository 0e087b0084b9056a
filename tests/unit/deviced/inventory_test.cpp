#include "inventory.hpp"

#include <gtest/gtest.h>

namespace rtpm::test {
namespace {

using device_io::FoundDevice;
using deviced::DriverInfo;

FoundDevice falcon() {
  return {.driver = "falcon",
          .model = "Novint Falcon",
          .serial = "F1",
          .node = "/dev/bus/usb/001/004",
          .arguments = "serial=F1",
          .udev_rule = "RULE-F"};
}

std::vector<FoundDevice> find_falcon() {
  return {falcon()};
}

TEST(DriverList, NamesDriversThatThisBuildLacks) {
  const auto make =
      [](const deviced::DeviceSettings&) -> expected<std::unique_ptr<driver::Driver>, SetupError> {
    return setup_error("no");
  };
  const std::vector<DriverInfo> drivers{{"arm", "simulated: an arm", +make, nullptr, ""},
                                        {"falcon", "Novint Falcon", nullptr, nullptr, "libusb-dev"},
                                        {"mpv", "mpv", nullptr, nullptr, ""}};
  EXPECT_EQ(deviced::list_text(drivers),
            "arm        simulated: an arm\n"
            "falcon     Novint Falcon (not in this build; it needs the Debian package "
            "libusb-dev)\n"
            "mpv        mpv (on Linux only)\n");
}

TEST(Drivers, AreListedOnce) {
  std::set<std::string> names;
  for (const DriverInfo& info : deviced::drivers())
    EXPECT_TRUE(names.insert(info.name).second) << info.name;
  EXPECT_STREQ(deviced::drivers().front().name, "arm");
  EXPECT_TRUE(deviced::is_driver("mpv"));
  EXPECT_FALSE(deviced::is_driver("lever"));
}

TEST(Drivers, NameTheirRequirementsIfLeftOut) {
  for (const DriverInfo& info : deviced::drivers()) {
    if (info.make != nullptr) continue;
    const auto made = deviced::make_driver({.name = "x0", .driver = info.name});
    ASSERT_FALSE(made);
    EXPECT_NE(made.error().text().find(info.package), std::string::npos) << made.error().text();
  }
  const auto unknown = deviced::make_driver({.name = "x0", .driver = "nothing"});
  ASSERT_FALSE(unknown);
  EXPECT_NE(unknown.error().remedy.find("arm, biometric"), std::string::npos);
}

TEST(Probe, AsksEachDriverThatCanProbe) {
  const std::vector<DriverInfo> drivers{{"arm", "", nullptr, nullptr, ""},
                                        {"falcon", "", nullptr, &find_falcon, ""},
                                        {"hid", "", nullptr, &find_falcon, ""}};
  EXPECT_EQ(deviced::probe(drivers).size(), 2u);
}

TEST(Probe, SaysHowToServeADevice) {
  EXPECT_EQ(deviced::probe_text({falcon()}, {}),
            "falcon     Novint Falcon, serial F1, at /dev/bus/usb/001/004\n"
            "           rtpm-deviced --devices falcon0 --device-falcon0-arguments 'serial=F1'\n");
}

TEST(Probe, NamesTheDriversThatFoundNothing) {
  const std::vector<DriverInfo> drivers{{"arm", "", nullptr, nullptr, ""},
                                        {"evdev", "", nullptr, &find_falcon, ""},
                                        {"hid", "", nullptr, &find_falcon, ""}};
  const std::string text = deviced::probe_text({}, drivers);
  EXPECT_NE(text.find("evdev, hid;"), std::string::npos) << text;
  EXPECT_NE(text.find("--list-drivers"), std::string::npos);
  EXPECT_NE(deviced::probe_text({}, {}).find("no driver of this build"), std::string::npos);
}

TEST(Probe, ListsInputsLeftOutAndDevicesNotServed) {
  FoundDevice pad = falcon();
  pad.left_out = "3 buttons: a sample holds 16";
  FoundDevice other = falcon();
  other.refusal = "its report descriptor is unreadable";
  other.missing_right = "reading and writing /dev/hidraw0";
  const std::string text = deviced::probe_text({other, pad}, {});
  EXPECT_NE(text.find("left out: 3 buttons: a sample holds 16\n"), std::string::npos) << text;
  EXPECT_NE(text.find("not served: its report descriptor is unreadable\n"), std::string::npos);
  EXPECT_EQ(text.find("falcon1"), std::string::npos) << "a refused one has no command";
  EXPECT_EQ(text.find("RULE-F"), std::string::npos) << "and needs no right";
}

TEST(Probe, GivesTheRulesOfMissingRightsOnce) {
  FoundDevice closed = falcon();
  closed.missing_right = "reading and writing /dev/bus/usb/001/004";
  const std::string text = deviced::probe_text({closed, closed, falcon()}, {});
  EXPECT_NE(text.find("missing: reading and writing /dev/bus"), std::string::npos) << text;
  EXPECT_NE(text.find("falcon1"), std::string::npos) << "each has a name of its own";
  EXPECT_NE(text.find("70-rtpm.rules"), std::string::npos);
  EXPECT_EQ(text.find("RULE-F"), text.rfind("RULE-F"));
}

TEST(Probe, EscapesTextOfADevice) {
  FoundDevice rude = falcon();
  rude.model = "bad\x1b[31m";
  rude.arguments = "serial=a'b";
  const std::string text = deviced::probe_text({rude}, {});
  EXPECT_EQ(text.find('\x1b'), std::string::npos);
  EXPECT_NE(text.find(R"('serial=a'\)"), std::string::npos) << text;
}

}  // namespace
}  // namespace rtpm::test
