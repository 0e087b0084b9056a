#include <gtest/gtest.h>

#include <functional>
#include <thread>

#include "hid_game_pad_model.hpp"
#include "hid_open_ff_board_model.hpp"
#include "hid_sony_pad_model.hpp"
#include "rtpm/device_hid/hid_driver.hpp"
#include "rtpm/device_hid/open.hpp"
#include "scripted_hid.hpp"

/// The driver with its threads, and models whose time only its reading advances.
namespace rtpm::device_hid {
namespace {

using driver::Command;
using driver::CommandMode;
using driver::ExchangeStatus;
using std::chrono::milliseconds;
using test::HidFault;

class HidDriverTest : public testing::Test {
 protected:
  void start(std::shared_ptr<test::HidModel> model, const Settings& settings = {}) {
    system_ = test::system_with(std::move(model));
    port_ = system_->plugged[0].port;
    auto made = HidDriver::create(system_, settings, "pad0");
    ASSERT_TRUE(made) << made.error().text();
    driver_ = std::move(*made);
    start_again();
  }
  void start_again() {
    const auto configured = driver_->configure({.period = milliseconds{4}});
    ASSERT_TRUE(configured) << configured.error().text();
    ASSERT_TRUE(driver_->activate());
  }
  ExchangeStatus exchange(CommandMode mode, float output = 0, double effort = 0,
                          Duration hold = std::chrono::hours{1}) {
    Command command;
    command.mode = mode;
    command.cycle_time = now_ += milliseconds{4};
    command.deadline = now_ + hold;
    command.outputs.fill(output);
    command.joints[0] = effort;
    sample_.faults = {};
    return driver_->exchange(command, sample_);
  }
  bool exchange_until(CommandMode mode, float output, double effort,
                      const std::function<bool(ExchangeStatus)>& is_done) {
    for (int i = 0; i < 1'000'000; ++i) {
      if (is_done(exchange(mode, output, effort))) return true;
      std::this_thread::yield();
    }
    return false;
  }
  bool wait_until(const std::function<bool(const test::HidModel&)>& is_done) {
    for (int i = 0; i < 2000; ++i) {
      if (port_->with_model(is_done)) return true;
      std::this_thread::sleep_for(milliseconds{1});
    }
    return false;
  }

  std::shared_ptr<test::ScriptedHidSystem> system_;
  std::shared_ptr<test::ScriptedHidPort> port_;
  std::unique_ptr<HidDriver> driver_;
  driver::Sample sample_{};
  MonotonicTime now_{std::chrono::seconds{1000}};
};

TEST_F(HidDriverTest, ReadsAndRumbles) {
  start(std::make_shared<test::DualShock4Model>(false));
  port_->with_model([](test::HidModel& pad) { return pad.press(1, true), 0; });
  ASSERT_TRUE(exchange_until(CommandMode::kOutputs, 1, 0, [&](auto status) {
    return status == ExchangeStatus::kOk && sample_.buttons == 2 && sample_.outputs_applied[0] == 1;
  }));
  EXPECT_FALSE(port_->with_model([](test::HidModel& pad) { return pad.is_safe(); }));
  EXPECT_EQ(sample_.button_edges[1], 1);
  ASSERT_TRUE(exchange_until(CommandMode::kOff, 1, 0,
                             [&](auto) { return sample_.outputs_applied[0] == 0; }));
  EXPECT_TRUE(port_->with_model([](test::HidModel& pad) { return pad.is_safe(); }));
}

TEST_F(HidDriverTest, LeavesADeviceSafeOnEveryWayOut) {
  const auto is_safe = [](test::HidModel& model) { return model.is_safe(); };
  for (const bool has_force : {false, true}) {
    for (const bool is_destroyed : {false, true}) {
      std::shared_ptr<test::HidModel> model = std::make_shared<test::DualSenseModel>(true);
      if (has_force) model = std::make_shared<test::OpenFfBoardModel>();
      start(model, {.torque_newton_metre = 5});
      const auto mode = has_force ? CommandMode::kJointEffort : CommandMode::kOutputs;
      ASSERT_TRUE(exchange_until(mode, 1, 5, [&](auto) { return !port_->with_model(is_safe); }));
      if (is_destroyed) {
        driver_.reset();
      } else {
        driver_->deactivate();
      }
      EXPECT_TRUE(port_->with_model(is_safe));
    }
  }
}

TEST_F(HidDriverTest, MakesADeviceSafeWhenNoCommandComesAnyMore) {
  start(std::make_shared<test::OpenFfBoardModel>(), {.torque_newton_metre = 5});
  const auto is_safe = [](const test::HidModel& model) { return model.is_safe(); };
  ASSERT_TRUE(exchange_until(CommandMode::kJointEffort, 0, 5,
                             [&](auto) { return !port_->with_model(is_safe); }));
  static_cast<void>(exchange(CommandMode::kJointEffort, 0, 5, milliseconds{30}));
  EXPECT_TRUE(wait_until(is_safe));
}

TEST_F(HidDriverTest, ReadsOnWhileAWriteHangs) {
  start(std::make_shared<test::DualShock4Model>(false));
  port_->hold_writes();
  bool is_read = exchange_until(CommandMode::kOutputs, 1, 0, [&](auto) {
    return sample_.device_time > std::chrono::seconds{1};
  });
  port_->with_model([](test::HidModel& pad) { return pad.press(0, true), 0; });
  is_read = is_read &&
            exchange_until(CommandMode::kOutputs, 1, 0, [&](auto) { return sample_.buttons == 1; });
  const float applied = sample_.outputs_applied[0];
  port_->release_writes();
  EXPECT_TRUE(is_read);
  EXPECT_EQ(applied, 0) << "not yet";
  EXPECT_TRUE(exchange_until(CommandMode::kOutputs, 1, 0,
                             [&](auto) { return sample_.outputs_applied[0] == 1; }));
}

TEST_F(HidDriverTest, TakesTheNewestRequestAfterAWriteThatHung) {
  start(std::make_shared<test::DualShock4Model>(false));
  port_->hold_writes();
  for (const float output : {0.2F, 0.4F, 0.6F, 0.8F, 1.0F})
    static_cast<void>(exchange(CommandMode::kOutputs, output));
  port_->release_writes();
  EXPECT_TRUE(wait_until([](const test::HidModel& model) {
    return dynamic_cast<const test::SonyPadModel&>(model).output(test::SonyPadModel::kStrong) ==
           255;
  }));
}

TEST_F(HidDriverTest, SaysSaturatedWhileItsOutputsAreRefused) {
  start(std::make_shared<test::DualShock4Model>(false));
  port_->set_fault(HidFault::kRefuses);
  EXPECT_TRUE(exchange_until(CommandMode::kOutputs, 1, 0, [&](auto) {
    return sample_.faults.has(driver::Fault::kDeviceSaturated);
  }));
  EXPECT_EQ(sample_.outputs_applied[0], 0);
  EXPECT_TRUE(exchange_until(CommandMode::kOutputs, 1, 0,
                             [](auto status) { return status == ExchangeStatus::kGone; }));
}

TEST_F(HidDriverTest, ComesBackAtAnotherNode) {
  start(std::make_shared<test::GamePadModel>());
  port_->with_model([](test::HidModel& pad) { return pad.press(0, true), 0; });
  ASSERT_TRUE(exchange_until(CommandMode::kOff, 0, 0, [&](auto) { return sample_.buttons == 1; }));
  port_->set_fault(HidFault::kUnplugged);
  ASSERT_TRUE(exchange_until(CommandMode::kOff, 0, 0,
                             [](auto status) { return status == ExchangeStatus::kGone; }));
  driver_->deactivate();
  const auto plugged = std::exchange(system_->plugged, {});
  const auto missing = driver_->configure({.period = milliseconds{4}});
  ASSERT_FALSE(missing);
  EXPECT_NE(missing.error().text().find("scripted-1 is not plugged in"), std::string::npos);
  system_->plug(std::make_shared<test::GamePadModel>(), "other", "usb-7/input0", "/dev/hidraw0");
  EXPECT_FALSE(driver_->configure({.period = milliseconds{4}})) << "another unit at its node";
  system_->plug(std::make_shared<test::GamePadModel>(), "scripted-1", "usb-8", "/dev/hidraw4");
  start_again();
  ASSERT_EQ(exchange(CommandMode::kOff), ExchangeStatus::kOk);
  EXPECT_EQ(sample_.buttons, 0u) << "what was pressed then counts as released";
  EXPECT_EQ(sample_.button_edges[0], 2);
}

TEST_F(HidDriverTest, RefusesMissingOrForbiddenUnits) {
  auto system = std::make_shared<test::ScriptedHidSystem>();
  const auto nothing = HidDriver::create(system, {}, "pad0");
  ASSERT_FALSE(nothing);
  EXPECT_NE(nothing.error().text().find("kind="), std::string::npos);
  const auto waiting = HidDriver::create(system, {.kind = Kind::kDualSense}, "pad0");
  ASSERT_TRUE(waiting);
  EXPECT_EQ((*waiting)->describe().serial, "hid-pad0");
  EXPECT_FALSE((*waiting)->configure({.period = milliseconds{4}}));
  system->plug(std::make_shared<test::DualSenseModel>(false), "1", "usb-1", "/dev/hidraw0");
  system->plugged[0].is_forbidden = true;
  EXPECT_FALSE((*waiting)->configure({.period = milliseconds{4}}));
  system->plugged[0].is_forbidden = false;
  EXPECT_TRUE((*waiting)->configure({.period = milliseconds{4}}));
  EXPECT_FALSE(open("kind=toaster", "pad0"));
}

}  // namespace
}  // namespace rtpm::device_hid
