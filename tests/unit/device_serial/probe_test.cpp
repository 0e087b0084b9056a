#include <gtest/gtest.h>

#include <map>
#include <memory>
#include <string_view>

#include "rtpm/device_serial/open.hpp"
#include "rtpm/device_serial/ports.hpp"
#include "umockdev.hpp"

/// The ports that libserialport finds among emulated USB devices of umockdev.
namespace rtpm::device_serial {
namespace {

struct Release {
  void operator()(UMockdevTestbed* testbed) const noexcept { g_object_unref(testbed); }
};

class SerialMockedUsb : public ::testing::Test {
 protected:
  void SetUp() override {
    if (const std::string obstacle = test::umockdev_obstacle(); !obstacle.empty())
      GTEST_SKIP() << obstacle;
    testbed_.reset(umockdev_testbed_new());
  }
  /// A board with its own port, as the kernel's cdc_acm shows it.
  void add_board(const std::string& address, const std::string& node, const std::string& serial) {
    const std::string description = "P: /devices/pci/usb1/" + address +
                                    "\n"
                                    "E: SUBSYSTEM=usb\nE: DEVTYPE=usb_device\n"
                                    "A: busnum=1\\n\nA: devnum=7\\n\n"
                                    "A: idVendor=2341\\n\nA: idProduct=0043\\n\n"
                                    "A: product=Arduino Uno\\n\nA: serial=" +
                                    serial +
                                    "\\n\n\n"
                                    "P: /devices/pci/usb1/" +
                                    address + "/" + address +
                                    ":1.0\nE: SUBSYSTEM=usb\nE: DEVTYPE=usb_interface\n\n"
                                    "P: /devices/pci/usb1/" +
                                    address + "/" + address + ":1.0/tty/" + node + "\nN: " + node +
                                    "\nE: SUBSYSTEM=tty\nE: DEVNAME=/dev/" + node +
                                    "\nL: device=../../../" + address + ":1.0\n\n";
    GError* error = nullptr;
    ASSERT_NE(umockdev_testbed_add_from_string(testbed_.get(), description.c_str(), &error), 0)
        << error->message;
  }

  std::unique_ptr<UMockdevTestbed, Release> testbed_{};
};

TEST_F(SerialMockedUsb, PortsAreListedWithTheirIds) {
  add_board("1-1", "ttyACM0", "U1");
  const std::vector<Port> ports = list_ports();
  ASSERT_EQ(ports.size(), 1u);
  EXPECT_EQ(ports[0].node, "/dev/ttyACM0");
  EXPECT_TRUE(ports[0].is_usb);
  EXPECT_EQ(ports[0].usb_vendor, 0x2341);
  EXPECT_EQ(ports[0].usb_product, 0x0043);
  EXPECT_EQ(ports[0].model, "Arduino Uno");
  EXPECT_EQ(ports[0].serial, "U1");
}

TEST_F(SerialMockedUsb, ProbePrintsTheOptionsOfEachBoard) {
  add_board("1-1", "ttyACM0", "U1");
  add_board("1-2", "ttyACM1", "T1");
  add_board("1-3", "ttyACM2", "T1");
  std::map<std::string, std::string> arguments;
  for (const device_io::FoundDevice& device : probe()) {
    arguments[device.node] = device.arguments;
    EXPECT_NE(device.udev_rule.find("{idVendor}==\"2341\""), std::string::npos);
  }
  EXPECT_EQ(arguments, (std::map<std::string, std::string>{{"/dev/ttyACM0", "serial=U1"},
                                                           {"/dev/ttyACM1", "port=/dev/ttyACM1"},
                                                           {"/dev/ttyACM2", "port=/dev/ttyACM2"}}));
}

}  // namespace
}  // namespace rtpm::device_serial
