#include "rtpm/device_serial/open.hpp"

#include <gtest/gtest.h>

#include "serial_model.hpp"

/// The operator's arguments, and the port that they select.
namespace rtpm::device_serial {
namespace {

using test::SerialModel;

const Port kUno{.node = "/dev/ttyACM0", .is_usb = true, .usb_vendor = 0x2341, .serial = "U1"};
const Port kTeensy{.node = "/dev/ttyACM1", .is_usb = true, .usb_vendor = 0x16c0, .serial = "T1"};
const Port kTwin{.node = "/dev/ttyACM2", .is_usb = true, .usb_vendor = 0x2341, .serial = "U1"};
const Port kBuiltIn{.node = "/dev/ttyS0"};

std::string chosen(const PortSettings& settings, const std::vector<Port>& ports) {
  const auto port = choose_port(settings, ports);
  return port ? port->node : port.error().text();
}

TEST(SerialPorts, AreChosenByNodeSerialNumberOrBecauseThereIsOne) {
  EXPECT_EQ(chosen({.port = "/dev/ttyS0"}, {kBuiltIn, kUno}), "/dev/ttyS0");
  EXPECT_EQ(chosen({.port = "/dev/ttyX"}, {kUno}), "/dev/ttyX") << "opening it says what is wrong";
  EXPECT_EQ(chosen({.serial = "T1"}, {kUno, kTeensy}), "/dev/ttyACM1");
  EXPECT_EQ(chosen({}, {kBuiltIn, kUno}), "/dev/ttyACM0");
}

TEST(SerialPorts, AreNotGuessed) {
  EXPECT_NE(chosen({}, {kBuiltIn}).find("not plugged in"), std::string::npos);
  EXPECT_NE(chosen({.serial = "T1"}, {kUno}).find("T1 is not plugged in"), std::string::npos);
  const std::string several = chosen({}, {kUno, kTeensy});
  EXPECT_NE(several.find("/dev/ttyACM0, /dev/ttyACM1"), std::string::npos) << several;
  const std::string twins = chosen({.serial = "U1"}, {kUno, kTwin});
  EXPECT_NE(twins.find("2 ports are a board of serial number U1"), std::string::npos) << twins;
  EXPECT_NE(twins.find("by-path"), std::string::npos) << twins;
  EXPECT_EQ(chosen({.port = "/dev/ttyACM2", .serial = "U1"}, {kUno, kTwin}), "/dev/ttyACM2");
}

TEST(SerialSettings, AreRead) {
  const auto settings = read_settings("port=/dev/ttyUSB3  speed=1000000 serial=X9");
  ASSERT_TRUE(settings);
  EXPECT_EQ(settings->port, "/dev/ttyUSB3");
  EXPECT_EQ(settings->serial, "X9");
  EXPECT_EQ(settings->speed_baud, 1'000'000);
  EXPECT_EQ(read_settings("")->speed_baud, 115'200);
}

TEST(SerialSettings, AreRefusedWithTheReason) {
  for (const char* words : {"baud=9600", "port", "port=", "speed=fast", "speed=115200x", "speed=0",
                            "speed=-9600", "speed=99999999999999999999", "speed=1 speed=2"}) {
    const auto settings = read_settings(words);
    ASSERT_FALSE(settings) << words;
    EXPECT_GT(settings.error().text().size(), 30u) << words;
  }
}

class SerialOpen : public ::testing::Test {
 protected:
  driver::Descriptor describe(std::string_view arguments, std::vector<Port> ports) {
    auto opened = device_serial::open(
        arguments, "lab", [ports = std::move(ports)] { return ports; },
        [this](const PortSettings& settings) {
          opened_ = settings;
          return test::open_model(model_)(settings);
        });
    driver_ = opened ? std::move(*opened) : nullptr;
    return driver_ == nullptr ? driver::Descriptor{} : driver_->describe();
  }
  std::shared_ptr<SerialModel> model_ = std::make_shared<SerialModel>();
  std::unique_ptr<driver::Driver> driver_;
  PortSettings opened_;
};

TEST_F(SerialOpen, ReadsTheDescriptionOfAConnectedBoard) {
  model_->set_joint_name("lever");
  const driver::Descriptor descriptor = describe("", {kUno});
  ASSERT_EQ(descriptor.joints.size(), 1u);
  EXPECT_EQ(descriptor.joints[0].name, "lever");
  EXPECT_EQ(descriptor.model, "RTPM paddle");
  EXPECT_EQ(descriptor.serial, "U1");
  EXPECT_EQ(descriptor.frame, "lab/base");
  ASSERT_TRUE(driver_->configure({}));
  EXPECT_EQ(opened_.serial, "U1") << "found again by it, at whatever port";
}

TEST_F(SerialOpen, AssumesTheFirmwaresOwnBoardIfNoneIsConnected) {
  const driver::Descriptor descriptor = describe("serial=U1", {});
  ASSERT_EQ(descriptor.joints.size(), 1u);
  EXPECT_EQ(descriptor.joints[0].name, "paddle");
  EXPECT_EQ(descriptor.serial, "U1");
  EXPECT_TRUE(driver_->configure({})) << "a board that came meanwhile";
}

TEST_F(SerialOpen, HasASerialNumberWhateverTheBoardHas) {
  EXPECT_EQ(describe("serial=S", {kUno}).serial, "S");
  const Port nameless{.node = "/dev/ttyUSB0", .is_usb = true};
  EXPECT_EQ(describe("", {nameless}).serial, SerialModel::kSerial) << "the board's own";
  model_->set_serial("");
  EXPECT_EQ(describe("port=/dev/ttyUSB0", {nameless}).serial, "/dev/ttyUSB0");
  EXPECT_EQ(describe("", {nameless}).serial, "/dev/ttyUSB0");
  EXPECT_EQ(describe("", {}).serial, "unknown");
}

}  // namespace
}  // namespace rtpm::device_serial
