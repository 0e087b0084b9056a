#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdlib>
#include <fstream>
#include <functional>
#include <thread>

#include "emulated_bus.hpp"
#include "faults.hpp"
#include "rtpm/device_falcon/kinematics.hpp"
#include "rtpm/device_falcon/open.hpp"
#include "umockdev.hpp"

/// The driver with the real libusb, and models of units behind an emulated kernel. Functional only:
/// each transfer takes several messages between threads.
namespace rtpm::device_falcon {
namespace {

using driver::Command;
using driver::CommandMode;
using driver::ExchangeStatus;
using driver::Vector3;
using test::EmulatedBus;
using test::FalconFault;
using test::FalconModel;
using test::FalconModelConfig;
using test::FalconStep;

constexpr driver::DriverConfig kConfig{.period = std::chrono::milliseconds{1}};
const Vector3 kPush{0, 0, 2};

class FalconUsb : public testing::Test {
 protected:
  void SetUp() override {
    if (const std::string obstacle = test::umockdev_obstacle(); !obstacle.empty())
      GTEST_SKIP() << obstacle;
    bus_ = std::make_unique<EmulatedBus>();
  }
  void TearDown() override {
    driver_.reset();
    bus_.reset();
  }

  std::shared_ptr<FalconModel> plug_in(const FalconModelConfig& config, int port, int address) {
    auto model = std::make_shared<FalconModel>(config);
    bus_->plug_in(model, port, address);
    return model;
  }
  void make(const std::string& arguments) {
    auto opened = open(arguments, "lab/falcon0");
    ASSERT_TRUE(opened) << opened.error().text();
    driver_ = std::move(*opened);
  }
  bool try_start() {
    const auto configured = driver_->configure(kConfig);
    return configured && driver_->activate();
  }
  /// Retries like the device server: a machine that is busy for 100 ms makes a unit look gone.
  void start() {
    bool is_started = false;
    for (int i = 0; i < 5 && !is_started; ++i)
      is_started = try_start();
    ASSERT_TRUE(is_started) << "five times";
  }
  ExchangeStatus exchange(const Vector3& force) {
    Command command;
    command.mode = CommandMode::kForce;
    command.wrench.force_newton = force;
    command.deadline = kNever;
    sample_.faults = {};
    return driver_->exchange(command, sample_);
  }
  bool exchange_until(const Vector3& force, const std::function<bool(ExchangeStatus)>& is_done) {
    for (int i = 0; i < 5000; ++i) {
      const ExchangeStatus status = exchange(force);
      if (is_done(status)) return true;
      if (status == ExchangeStatus::kGone) {
        driver_->deactivate();
        static_cast<void>(try_start());
      }
      std::this_thread::sleep_for(std::chrono::milliseconds{1});
    }
    return false;
  }
  /// Allows for single late cycles on a busy machine.
  bool goes_on() {
    return exchange_until({}, [](auto status) { return status == ExchangeStatus::kOk; });
  }
  bool has_force(const std::shared_ptr<FalconModel>& model) {
    return bus_->with_model(model, [](const FalconModel& unit) { return unit.has_force(); });
  }

  std::unique_ptr<EmulatedBus> bus_;
  std::unique_ptr<driver::Driver> driver_;
  driver::Sample sample_{};
};

TEST_F(FalconUsb, ProbeNamesEachUnit) {
  EXPECT_TRUE(probe().empty());
  plug_in({.serial = "A"}, 1, 5);
  plug_in({.serial = "B"}, 2, 6);
  auto found = probe();
  ASSERT_EQ(found.size(), 2u);
  if (found[0].serial == "B") std::swap(found[0], found[1]);
  EXPECT_EQ(found[0].serial, "A");
  EXPECT_EQ(found[1].arguments, "port=1-2");
  EXPECT_EQ(found[1].node, "/dev/bus/usb/001/006");
  EXPECT_EQ(found[0].missing_right, "");
  EXPECT_NE(found[0].udev_rule.find("cb48"), std::string::npos);
}

TEST_F(FalconUsb, PushesTheGripAndEndsWithoutForce) {
  const auto model = plug_in({}, 1, 5);
  make("");
  EXPECT_EQ(driver_->describe().serial, "FALCON01");
  start();
  EXPECT_TRUE(goes_on());
  ASSERT_TRUE(exchange_until(kPush, [&](auto) { return sample_.pose.position_m.z > 0.003; }));
  EXPECT_TRUE(has_force(model));
  driver_->deactivate();
  EXPECT_FALSE(has_force(model));
}

TEST_F(FalconUsb, LoadsTheFirmware) {
  const std::string path = testing::TempDir() + "falcon_usb_firmware";
  std::ofstream file(path, std::ios::binary);
  for (const std::byte byte : FalconModel::firmware())
    file.put(static_cast<char>(byte));
  file.close();
  plug_in({.has_firmware = false}, 1, 5);
  make("firmware=" + path);
  start();
  EXPECT_TRUE(goes_on());
}

TEST_F(FalconUsb, IsGoneWithItsUnitAndFindsItAtAnotherAddress) {
  const auto model = plug_in({.serial = "A"}, 1, 5);
  make("");
  start();
  ASSERT_TRUE(exchange_until(kPush, [&](auto) { return has_force(model); }));
  bus_->unplug(model);
  ASSERT_TRUE(exchange_until(kPush, [](auto status) { return status == ExchangeStatus::kGone; }));
  driver_->deactivate();
  const auto other = plug_in({.serial = "B"}, 2, 6);
  const auto configured = driver_->configure(kConfig);
  ASSERT_FALSE(configured) << "another unit is not it";
  EXPECT_NE(configured.error().text().find("'A'"), std::string::npos) << configured.error().text();
  bus_->plug_in(model, 3, 7);
  ASSERT_TRUE(driver_->configure(kConfig));
  EXPECT_FALSE(has_force(model)) << "what it may have held ends with the first packet";
  if (!driver_->activate()) start();
  EXPECT_TRUE(goes_on());
  EXPECT_EQ(bus_->with_model(other, [](const FalconModel& unit) { return unit.packet_count(); }),
            0u);
}

TEST_F(FalconUsb, RefusesTwoUnitsWithOneSerialNumberUnlessToldThePort) {
  plug_in({.serial = "A"}, 1, 5);
  plug_in({.serial = "A"}, 2, 6);
  make("serial=A");
  const auto configured = driver_->configure(kConfig);
  ASSERT_FALSE(configured);
  EXPECT_NE(configured.error().text().find("port=1-2"), std::string::npos)
      << configured.error().text();
  make("port=1-2");
  start();
  EXPECT_TRUE(goes_on());
}

TEST_F(FalconUsb, OvercomesARequestThatIsRefusedOrNotAnsweredOnce) {
  for (const auto fault : {FalconFault::kStall, FalconFault::kNoAnswer}) {
    const auto model = plug_in({.plan = {fault, FalconStep::kRequest, 2, 1}}, 1, 5);
    make("");
    const auto configured = driver_->configure(kConfig);
    ASSERT_TRUE(configured) << configured.error().text();
    if (!driver_->activate()) start();
    EXPECT_TRUE(goes_on());
    driver_.reset();
    bus_.reset();
    bus_ = std::make_unique<EmulatedBus>();
  }
}

TEST_F(FalconUsb, ReportsUnansweredRequests) {
  for (const auto fault : {FalconFault::kStall, FalconFault::kNoAnswer, FalconFault::kNoDevice}) {
    const auto model = plug_in({.plan = {fault, FalconStep::kRequest, 1}}, 1, 5);
    make("");
    const auto configured = driver_->configure(kConfig);
    ASSERT_FALSE(configured);
    EXPECT_NE(configured.error().text().find("Remedy"), std::string::npos);
    EXPECT_FALSE(has_force(model));
    driver_.reset();
    bus_.reset();
    bus_ = std::make_unique<EmulatedBus>();
  }
}

class FalconUsbFaults : public FalconUsb, public testing::WithParamInterface<FalconFault> {};

TEST_P(FalconUsbFaults, EndWithoutForce) {
  const auto model = plug_in({}, 1, 5);
  make("");
  start();
  ASSERT_TRUE(exchange_until(kPush, [&](auto) { return has_force(model); }));
  bus_->with_model(model, [](FalconModel& unit) {
    unit.set_plan({GetParam(), FalconStep::kPacket, 3});
  });
  for (int i = 0; i < 120 && exchange(kPush) != ExchangeStatus::kGone; ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds{1});
  driver_->deactivate();
  bus_->with_model(model, [](FalconModel& unit) {
    unit.set_plan({});
    unit.plug_in();
  });
  start();
  EXPECT_FALSE(has_force(model));
  EXPECT_TRUE(goes_on());
}

INSTANTIATE_TEST_SUITE_P(All, FalconUsbFaults, testing::ValuesIn(test::all_faults()),
                         [](const auto& test) { return test::to_string(test.param); });

}  // namespace
}  // namespace rtpm::device_falcon
