#include <gtest/gtest.h>
#include <signal.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <fstream>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "falcon_model.hpp"
#include "hosted_device.hpp"
#include "rtpm/rt/clock.hpp"
#include "usbip_bridge.hpp"

/// The model of a Falcon behind the kernel's USB stack, served by the driver `falcon` with libusb.
namespace rtpm::vm_test {
namespace {

using device_bridges::UsbStatus;
using driver::Lifecycle;

/// A model and its wiring to the bridge.
struct Wiring {
  test::FalconModel model{};
  std::optional<MonotonicTime> last{};
  /// Packets after which the motors had a force.
  std::uint64_t force_count = 0;

  void advance(MonotonicTime now) {
    model.advance(now - last.value_or(now));
    last = now;
  }
};

UsbStatus status_of(test::UsbReply reply) {
  switch (reply) {
    case test::UsbReply::kOk:
      return UsbStatus::kDone;
    case test::UsbReply::kNothingYet:
      return UsbStatus::kNotReady;
    default:
      return UsbStatus::kStall;
  }
}

device_bridges::UsbModel bridged(Wiring& wiring) {
  device_bridges::UsbModel bridged;
  std::ranges::copy(test::FalconModel::device_descriptor(), bridged.device_descriptor.begin());
  const auto configuration = test::FalconModel::configuration_descriptor();
  bridged.configuration_descriptor.assign(configuration.begin(), configuration.end());
  bridged.strings = {"NOVINT", "FALCON HAPTIC", wiring.model.serial()};
  bridged.on_control = [&wiring](const device_bridges::UsbSetup& setup,
                                 std::span<const std::byte> data) {
    wiring.advance(rt::now());
    std::vector<std::byte> bytes(data.begin(), data.end());
    bytes.resize(setup.length);
    const test::UsbAnswer answer = wiring.model.control({.type = setup.request_type,
                                                         .request = setup.request,
                                                         .value = setup.value,
                                                         .index = setup.index,
                                                         .length = setup.length},
                                                        bytes);
    bytes.resize(answer.size);
    return device_bridges::UsbAnswer{status_of(answer.reply), std::move(bytes)};
  };
  bridged.on_out = [&wiring](std::uint8_t, std::span<const std::byte> data) {
    wiring.advance(rt::now());
    const test::UsbAnswer answer = wiring.model.write(data);
    if (wiring.model.has_force()) ++wiring.force_count;
    return device_bridges::UsbAnswer{status_of(answer.reply)};
  };
  bridged.on_in = [&wiring](std::uint8_t, std::size_t capacity, MonotonicTime now) {
    wiring.advance(now);
    std::vector<std::byte> bytes(capacity);
    const test::UsbAnswer answer = wiring.model.read(bytes);
    bytes.resize(answer.size);
    return device_bridges::UsbAnswer{status_of(answer.reply), std::move(bytes)};
  };
  return bridged;
}

class Falcon : public HostedDevice {
 protected:
  void SetUp() override {
    if (const std::string missing = missing_vhci(); !missing.empty()) GTEST_SKIP() << missing;
    plug();
  }
  void plug() {
    const auto plugged = bridge_.plug();
    ASSERT_TRUE(plugged) << plugged.error().text();
  }
  /// Moves the hand along x, and checks that the client reads the grip there.
  void expect_motion(double x_m) {
    bridge_.with_model([&] { wiring_.model.hold_at({x_m, 0, 0}); });
    EXPECT_TRUE(await_sample([&](const driver::Sample& sample) {
      return std::abs(sample.pose.position_m.x - x_m) < 0.002;
    }));
  }
  [[nodiscard]] bool has_force() {
    return bridge_.with_model([&] { return wiring_.model.has_force(); });
  }
  [[nodiscard]] std::uint64_t force_count() {
    return bridge_.with_model([&] { return wiring_.force_count; });
  }
  void command_force() {
    ASSERT_TRUE(client_->acquire(kPatience));
    EXPECT_TRUE(command_until(driver::Setpoint::with_wrench({.force_newton = {1, 0, 0}}),
                              [&] { return has_force(); }));
  }

  Wiring wiring_{};
  device_bridges::UsbipBridge bridge_{bridged(wiring_)};
};

TEST_F(Falcon, IsReadUnpluggedAndReplugged) {
  ASSERT_TRUE(host("falcon", ""));
  ASSERT_TRUE(await_lifecycle(Lifecycle::kActive));
  EXPECT_EQ(client_->descriptor().serial, wiring_.model.serial());
  const auto probe = system_test::run_program("rtpm-deviced", {"--probe"});
  EXPECT_NE(probe.output.find("serial " + wiring_.model.serial()), std::string::npos)
      << probe.output;
  expect_motion(0.02);
  bridge_.unplug();
  EXPECT_TRUE(await_lifecycle(Lifecycle::kFault));
  plug();
  EXPECT_TRUE(await_lifecycle(Lifecycle::kActive));
  expect_motion(-0.02);
}

TEST_F(Falcon, HasNoForceWhenItsCommandEnds) {
  ASSERT_TRUE(host("falcon", ""));
  ASSERT_TRUE(await_lifecycle(Lifecycle::kActive));
  command_force();
  EXPECT_TRUE(await([&] { return !has_force(); }));
}

TEST_F(Falcon, HasNoForceWhenItComesBack) {
  ASSERT_TRUE(host("falcon", ""));
  ASSERT_TRUE(await_lifecycle(Lifecycle::kActive));
  command_force();
  // The model's motors go on as before.
  bridge_.unplug();
  EXPECT_TRUE(await_lifecycle(Lifecycle::kFault));
  const std::uint64_t before = force_count();
  plug();
  EXPECT_TRUE(await_lifecycle(Lifecycle::kActive));
  EXPECT_TRUE(await([&] { return !has_force(); }));
  EXPECT_EQ(force_count(), before) << "there was a force before a client commanded it";
}

TEST_F(Falcon, HasNoForceWhenItsServerStops) {
  ASSERT_TRUE(host("falcon", ""));
  ASSERT_TRUE(await_lifecycle(Lifecycle::kActive));
  command_force();
  device_->process.send_signal(SIGTERM);
  const auto end = device_->process.wait(kPatience);
  ASSERT_TRUE(end);
  EXPECT_EQ(end->exit_code, 0) << end->errors;
  EXPECT_FALSE(has_force());
}

class FalconWithoutFirmware : public Falcon {
 protected:
  FalconWithoutFirmware() { wiring_.model = test::FalconModel({.has_firmware = false}); }
};

TEST_F(FalconWithoutFirmware, GetsItFromTheUsersFile) {
  const std::string path = "/tmp/firmware.bin";
  const std::vector<std::byte> firmware = test::FalconModel::firmware();
  std::ofstream file(path, std::ios::binary);
  for (const std::byte byte : firmware)
    file.put(static_cast<char>(byte));
  file.close();
  ASSERT_TRUE(host("falcon", "firmware=" + path));
  ASSERT_TRUE(await_lifecycle(Lifecycle::kActive));
  expect_motion(0.01);
}

}  // namespace
}  // namespace rtpm::vm_test
