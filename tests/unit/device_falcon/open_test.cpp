#include "rtpm/device_falcon/open.hpp"

#include <gtest/gtest.h>

#include <fstream>
#include <string>

#include "rtpm/device_falcon/start_up.hpp"
#include "rtpm/device_falcon/units.hpp"

/// The operator's arguments, checked without any unit.
namespace rtpm::device_falcon {
namespace {

const std::vector<Unit> kTwo{{"A", "1-1", "/dev/bus/usb/001/002"},
                             {"B", "1-2.4", "/dev/bus/usb/001/003"}};
const std::vector<Unit> kTwins{{"A", "1-1", "/dev/bus/usb/001/002"},
                               {"A", "1-2", "/dev/bus/usb/001/003"}};

TEST(FalconUnits, AreChosenBySerialOrPort) {
  EXPECT_EQ(*choose(kTwo, {.serial = "B"}), 1u);
  EXPECT_EQ(*choose(kTwo, {.port = "1-1"}), 0u);
  EXPECT_EQ(*choose({kTwo[1]}, {}), 0u);
  EXPECT_EQ(*choose(kTwins, {.serial = "A", .port = "1-2"}), 1u);
}

TEST(FalconUnits, AreRefusedIfTheChoiceIsAmbiguous) {
  const auto refusal = [](const std::vector<Unit>& units, const UnitChoice& choice) {
    const auto chosen = choose(units, choice);
    return chosen ? "taken" : chosen.error().text();
  };
  EXPECT_NE(refusal(kTwo, {}).find("port=1-2.4"), std::string::npos);
  EXPECT_NE(refusal(kTwins, {.serial = "A"}).find("more than one"), std::string::npos);
  EXPECT_NE(refusal(kTwo, {.serial = "C"}).find("port=1-1"), std::string::npos);
  EXPECT_NE(refusal(kTwo, {.serial = "A", .port = "1-2.4"}).find("no Falcon"), std::string::npos);
  EXPECT_NE(refusal({}, {}).find("power supply"), std::string::npos);
}

std::string file_of(const std::string& name, std::size_t size) {
  std::string path = testing::TempDir() + "falcon_open_" + name;
  std::ofstream(path, std::ios::binary) << std::string(size, 'x');
  return path;
}

TEST(FalconOpen, AcceptsTheOperatorsOptions) {
  const auto driver = open("serial=A firmware=" + file_of("some firmware", 8000), "lab/falcon0");
  ASSERT_TRUE(driver) << driver.error().text();
  EXPECT_EQ((*driver)->describe().serial, "A");
  EXPECT_EQ((*driver)->describe().frame, "lab/falcon0/base");
  EXPECT_EQ((*open("port=9-9.9", "f"))->describe().serial, "port-9-9.9");
  EXPECT_FALSE((*open("", "f"))->describe().serial.empty());
}

TEST(FalconOpen, RefusesInvalidOptionsWithTheReason) {
  for (const std::string& arguments :
       {std::string("speed=3"), std::string("serial="), std::string("firmware=/no/such/file"),
        "firmware=" + file_of("short", kFirmwareSizeMin - 1),
        "firmware=" + file_of("long", kFirmwareSizeMax + 1), std::string("firmware=/dev")}) {
    const auto driver = open(arguments, "falcon0");
    ASSERT_FALSE(driver) << arguments;
    EXPECT_NE(driver.error().text().find("Remedy"), std::string::npos) << arguments;
  }
}

TEST(FalconOpen, SaysThatAUnitIsNotPluggedIn) {
  auto driver = open("serial=NOT-A-REAL-ONE", "falcon0");
  ASSERT_TRUE(driver);
  const auto configured = (*driver)->configure({});
  ASSERT_FALSE(configured);
  EXPECT_NE(configured.error().text().find("Remedy"), std::string::npos);
}

}  // namespace
}  // namespace rtpm::device_falcon
