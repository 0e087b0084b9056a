#include <gtest/gtest.h>
#include <signal.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "hid_game_pad_model.hpp"
#include "hid_sony_pad_model.hpp"
#include "hid_space_mouse_model.hpp"
#include "hosted_device.hpp"
#include "uhid_bridge.hpp"

/// Models of HID devices behind the kernel's HID stack, served by the driver `hid`.
namespace rtpm::vm_test {
namespace {

using driver::Lifecycle;

constexpr const char* kSerialNumber = "unit-7";

std::vector<std::byte> to_bytes(const test::HidReport& report) {
  std::vector<std::byte> bytes(report.size());
  std::transform(report.begin(), report.end(), bytes.begin(),
                 [](std::uint8_t byte) { return std::byte{byte}; });
  return bytes;
}

test::HidReport to_report(std::span<const std::byte> bytes) {
  test::HidReport report(bytes.size());
  std::transform(bytes.begin(), bytes.end(), report.begin(),
                 [](std::byte byte) { return std::to_integer<std::uint8_t>(byte); });
  return report;
}

/// A model and its wiring to the bridge.
struct Wiring {
  std::unique_ptr<test::HidModel> model;
  std::optional<MonotonicTime> last{};
  /// Output reports after which the model was not safe.
  std::uint64_t unsafe_count = 0;
};

device_bridges::HidModel bridged(Wiring& wiring) {
  const test::HidIdentity identity = wiring.model->identity();
  device_bridges::HidModel bridged;
  bridged.identity = {.bus = static_cast<std::uint16_t>(identity.is_bluetooth ? 5 : 3),
                      .vendor = identity.vendor,
                      .product = identity.product,
                      .version = 0x0100,
                      .name = identity.name,
                      .serial_number = kSerialNumber};
  bridged.report_descriptor = to_bytes(wiring.model->report_descriptor());
  bridged.next_input_report = [&wiring](MonotonicTime now) {
    wiring.model->advance(now - wiring.last.value_or(now));
    wiring.last = now;
    test::HidReport report;
    return wiring.model->take_input(report) ? to_bytes(report) : std::vector<std::byte>{};
  };
  bridged.on_output_report = [&wiring](std::span<const std::byte> report) {
    static_cast<void>(wiring.model->write(to_report(report)));
    if (!wiring.model->is_safe()) ++wiring.unsafe_count;
  };
  bridged.on_get_feature_report = [&wiring](std::uint8_t number) {
    return to_bytes(wiring.model->read_feature(number));
  };
  return bridged;
}

struct Case {
  const char* name;
  std::unique_ptr<test::HidModel> (*make)();
};
void PrintTo(const Case& value, std::ostream* out) {
  *out << value.name;
}

template <class Model, auto... Arguments>
std::unique_ptr<test::HidModel> make() {
  return std::make_unique<Model>(Arguments...);
}
constexpr Case kSpaceMouse{
    "SpaceMouse", &make<test::SpaceMouseModel, test::SpaceMouseModel::Layout::kTwoReports>};
constexpr Case kGamePad{"GamePad", &make<test::GamePadModel>};
constexpr Case kDualShock4{"DualShock4", &make<test::DualShock4Model, false>};

std::string name_of(const testing::TestParamInfo<Case>& tested) {
  return tested.param.name;
}

class HidDevice : public HostedDevice, public testing::WithParamInterface<Case> {
 protected:
  void SetUp() override { set_up("hid"); }
  void set_up(const std::string& driver) {
    if (const std::string missing = missing_uhid(); !missing.empty()) GTEST_SKIP() << missing;
    plug();
    ASSERT_TRUE(host(driver, std::string("serial=") + kSerialNumber));
    ASSERT_TRUE(await_lifecycle(Lifecycle::kActive));
  }
  void plug() {
    const auto plugged = bridge_.plug();
    ASSERT_TRUE(plugged) << plugged.error().text();
    ASSERT_NE(wait_for_hidraw_node(kSerialNumber), "");
  }
  /// Moves an axis and presses a button, and checks that the client reads both.
  void expect_input() {
    bridge_.with_model([&] {
      wiring_.model->move(0, 0.75);
      wiring_.model->press(0, true);
    });
    EXPECT_TRUE(await_sample([](const driver::Sample& sample) {
      return sample.buttons == 1 && sample.analogs[0] != 0;
    }));
    bridge_.with_model([&] {
      wiring_.model->move(0, 0);
      wiring_.model->press(0, false);
    });
    EXPECT_TRUE(await_sample([](const driver::Sample& sample) {
      return sample.buttons == 0 && std::abs(sample.analogs[0]) < 0.01F;
    }));
  }
  [[nodiscard]] bool is_safe() {
    return bridge_.with_model([&] { return wiring_.model->is_safe(); });
  }
  [[nodiscard]] std::uint64_t unsafe_count() {
    return bridge_.with_model([&] { return wiring_.unsafe_count; });
  }
  /// Commands the first output until the model has it.
  void command_output() {
    ASSERT_TRUE(client_->acquire(kPatience));
    EXPECT_TRUE(command_until(driver::Setpoint::with_outputs({1.0F}), [&] { return !is_safe(); }));
  }

  Wiring wiring_{.model = GetParam().make()};
  device_bridges::UhidBridge bridge_{bridged(wiring_)};
};
/// Devices that have outputs.
class HidOutputs : public HidDevice {};
/// Devices as the kernel's input layer shows them.
class InputDevice : public HidDevice {
 protected:
  void SetUp() override { set_up("evdev"); }
};

TEST_P(HidDevice, IsReadUnpluggedAndReplugged) {
  expect_input();
  bridge_.unplug();
  EXPECT_TRUE(await_lifecycle(Lifecycle::kFault));
  plug();
  EXPECT_TRUE(await_lifecycle(Lifecycle::kActive));
  expect_input();
}

TEST_P(HidDevice, IsFoundByProbe) {
  const auto probe = system_test::run_program("rtpm-deviced", {"--probe"});
  EXPECT_EQ(probe.exit_code, 0) << probe.errors;
  for (const std::string& text :
       {std::string("hid "), "serial " + std::string(kSerialNumber), hidraw_node(kSerialNumber)}) {
    EXPECT_NE(probe.output.find(text), std::string::npos) << text << " is not in " << probe.output;
  }
}

TEST_P(InputDevice, IsReadUnpluggedAndReplugged) {
  expect_input();
  bridge_.unplug();
  EXPECT_TRUE(await_lifecycle(Lifecycle::kFault));
  plug();
  EXPECT_TRUE(await_lifecycle(Lifecycle::kActive));
  expect_input();
}

TEST_P(HidOutputs, AreOffWhenTheirCommandEnds) {
  command_output();
  EXPECT_TRUE(await([&] { return is_safe(); }));
}

TEST_P(HidOutputs, AreOffWhenTheDeviceComesBack) {
  command_output();
  // The model keeps its power and its outputs.
  bridge_.unplug();
  EXPECT_TRUE(await_lifecycle(Lifecycle::kFault));
  const std::uint64_t before = unsafe_count();
  plug();
  EXPECT_TRUE(await_lifecycle(Lifecycle::kActive));
  EXPECT_TRUE(await([&] { return is_safe(); }));
  EXPECT_EQ(unsafe_count(), before) << "an output was on before a client commanded it";
}

TEST_P(HidOutputs, AreOffWhenTheServerStops) {
  command_output();
  device_->process.send_signal(SIGTERM);
  const auto end = device_->process.wait(kPatience);
  ASSERT_TRUE(end);
  EXPECT_EQ(end->exit_code, 0) << end->errors;
  EXPECT_TRUE(await([&] { return is_safe(); }));
}

INSTANTIATE_TEST_SUITE_P(Uhid, HidDevice, testing::Values(kSpaceMouse, kGamePad, kDualShock4),
                         name_of);
INSTANTIATE_TEST_SUITE_P(Uhid, InputDevice, testing::Values(kGamePad), name_of);
INSTANTIATE_TEST_SUITE_P(Uhid, HidOutputs, testing::Values(kSpaceMouse, kDualShock4), name_of);

}  // namespace
}  // namespace rtpm::vm_test
