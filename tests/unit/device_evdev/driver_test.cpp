#include <gtest/gtest.h>
#include <linux/input.h>

#include <cmath>
#include <functional>
#include <memory>
#include <thread>

#include "evdev_model.hpp"
#include "rtpm/device_evdev/evdev_driver.hpp"

/// The driver with its threads, before a model whose time only the test advances.
namespace rtpm::device_evdev {
namespace {

using driver::Command;
using driver::CommandMode;
using driver::ExchangeStatus;
using driver::Sample;
using std::chrono::milliseconds;
using test::EvdevModel;

class EvdevDriverTest : public testing::Test {
 protected:
  void use(Capabilities capabilities, Settings settings = {}) {
    model_ = std::make_unique<EvdevModel>(std::move(capabilities));
    driver_ = std::make_unique<EvdevDriver>(model_->access(), std::move(settings), "wheel0/base");
  }
  void start() {
    const auto configured = driver_->configure({.period = milliseconds{1}});
    ASSERT_TRUE(configured) << configured.error().text();
    const auto activated = driver_->activate();
    ASSERT_TRUE(activated) << activated.error().text();
  }
  ExchangeStatus exchange(const Command& asked) {
    Command command = asked;
    command.cycle_time = model_->now();
    command.deadline = command.cycle_time + milliseconds{30};
    sample_.faults = {};
    return driver_->exchange(command, sample_);
  }
  /// Exchanges until `is_done`; the model's time does not advance.
  bool exchange_until(const Command& command, const std::function<bool(ExchangeStatus)>& is_done) {
    for (int i = 0; i < 20'000; ++i) {
      if (is_done(exchange(command))) return true;
      std::this_thread::sleep_for(std::chrono::microseconds{50});
    }
    return false;
  }
  bool reaches(const Command& command, const Levels& levels) {
    return exchange_until(command, [&](auto) { return model_->levels() == levels; });
  }
  static Command effort(double newton_metre) {
    Command command;
    command.mode = CommandMode::kJointEffort;
    command.joints[0] = newton_metre;
    return command;
  }
  static Command outputs(float first, float second) {
    Command command;
    command.mode = CommandMode::kOutputs;
    command.outputs = {first, second};
    return command;
  }

  std::unique_ptr<EvdevModel> model_;
  std::unique_ptr<EvdevDriver> driver_;
  Sample sample_{};
};

TEST_F(EvdevDriverTest, ShowsTheInputsOfAHand) {
  use(EvdevModel::pad());
  start();
  model_->advance(milliseconds{5});
  const MonotonicTime pressed_at = model_->now();
  model_->move(ABS_Y, -32'768);
  model_->press(BTN_SOUTH, true);
  model_->report();
  model_->advance(milliseconds{2});
  ASSERT_TRUE(exchange_until({}, [&](auto) { return sample_.buttons == 1; }));
  EXPECT_EQ(sample_.analogs[1], -1) << "of the same report";
  EXPECT_EQ(sample_.button_edges[0], 1);
  EXPECT_LE(sample_.host_time, model_->now());
  EXPECT_GE(sample_.host_time, pressed_at);
}

TEST_F(EvdevDriverTest, AppliesEffortsAndStatesThem) {
  use(EvdevModel::wheel());
  start();
  ASSERT_TRUE(reaches(effort(1), {.effort = 16'383}));
  ASSERT_TRUE(exchange_until(effort(1), [&](auto) { return sample_.efforts_applied[0] > 0; }));
  EXPECT_NEAR(sample_.efforts_applied[0], 1, 1e-3);
  ASSERT_TRUE(reaches(effort(-1e9), {.effort = -32'767})) << "clamped, and never wrapped";
  EXPECT_TRUE(sample_.faults.has(driver::Fault::kDeviceSaturated));
  ASSERT_TRUE(reaches(effort(std::nan("")), {}));
  ASSERT_TRUE(reaches(outputs(0.5F, 1), {.spring = 16'383, .damper = 32'767}));
  ASSERT_TRUE(reaches({}, {})) << "nothing in mode off";
}

TEST_F(EvdevDriverTest, ReversesTheMotorIfConfigured) {
  use(EvdevModel::wheel(), {.scales = {.is_reversed = true}});
  start();
  ASSERT_TRUE(reaches(effort(2), {.effort = -32'767}));
  ASSERT_TRUE(exchange_until(effort(2), [&](auto) { return sample_.efforts_applied[0] == 2; }));
}

TEST_F(EvdevDriverTest, RumblesAndSetsTheGain) {
  use(EvdevModel::pad(), {.gain = 0.5});
  start();
  EXPECT_EQ(model_->gain(), 0.5);
  ASSERT_TRUE(reaches(outputs(1, 0.5F), {.strong = 65'535, .weak = 32'767}));
  ASSERT_TRUE(
      exchange_until(outputs(1, 0.5F), [&](auto) { return sample_.outputs_applied[0] == 1; }));
  driver_->deactivate();
  EXPECT_EQ(model_->abandoned_count(), 0u);
  EXPECT_FALSE(model_->was_left_playing());
}

TEST_F(EvdevDriverTest, EndsTheForceWhenNoCommandsCome) {
  use(EvdevModel::wheel());
  start();
  ASSERT_TRUE(reaches(effort(1), {.effort = 16'383}));
  // The last command's hold begins when the writing thread sees it, perhaps only after the first of
  // these iterations. An effect that nothing renews would end by itself after 500 ms.
  for (int i = 0; i < 5 && !model_->is_still(); ++i) {
    model_->advance(milliseconds{31});
    for (int j = 0; j < 4'000 && !model_->is_still(); ++j)
      std::this_thread::sleep_for(std::chrono::microseconds{50});
  }
  EXPECT_TRUE(model_->is_still()) << "after the command's deadline";
  ASSERT_TRUE(reaches(effort(1), {.effort = 16'383})) << "and goes on with the next";
}

TEST_F(EvdevDriverTest, ReadsWhileAWriteWaits) {
  use(EvdevModel::wheel());
  start();
  model_->set_blocked(true);
  ASSERT_EQ(exchange(effort(1)), ExchangeStatus::kOk);
  for (const bool is_down : {true, false, true}) {
    model_->press(BTN_TRIGGER, is_down);
    model_->report();
    ASSERT_TRUE(exchange_until(effort(1), [&](ExchangeStatus status) {
      return status == ExchangeStatus::kOk && (sample_.buttons & 1) == (is_down ? 1u : 0u);
    }));
  }
  EXPECT_TRUE(model_->is_still());
  model_->set_blocked(false);
  EXPECT_TRUE(reaches(effort(0.5), {.effort = 8'191})) << "the newest, and not those between";
}

TEST_F(EvdevDriverTest, IsGoneWhenUnpluggedAndFoundAtAnotherNode) {
  use(EvdevModel::wheel(), {.node = "/dev/input/event5"});
  for (int round = 0; round < 3; ++round) {
    start();
    model_->press(BTN_THUMB, true);
    model_->report();
    ASSERT_TRUE(exchange_until({}, [&](auto) { return sample_.buttons == 2; }));
    ASSERT_TRUE(reaches(effort(1), {.effort = 16'383}));
    const std::uint16_t edges = sample_.button_edges[1];
    model_->unplug();
    ASSERT_TRUE(
        exchange_until(effort(1), [](auto status) { return status == ExchangeStatus::kGone; }));
    EXPECT_EQ(sample_.buttons, 2u) << "unchanged";
    driver_->deactivate();
    const auto missing = driver_->configure({.period = milliseconds{1}});
    ASSERT_FALSE(missing);
    EXPECT_NE(missing.error().text().find("plug"), std::string::npos);
    model_->plug_in();
    start();
    ASSERT_TRUE(exchange_until({}, [&](auto) { return sample_.buttons == 0; }));
    EXPECT_EQ(sample_.button_edges[1], static_cast<std::uint16_t>(edges + 1)) << "goes on";
    driver_->deactivate();
  }
}

TEST_F(EvdevDriverTest, RefusesADeviceWithOtherChannels) {
  EvdevModel wheel(EvdevModel::wheel());
  wheel.unplug();
  EvdevDriver driver(wheel.access(), {.serial = "A1"}, "pad0/base");
  EXPECT_EQ(driver.describe().analogs.size(), 8u) << "of a game pad, as it is not there";
  EXPECT_EQ(driver.describe().serial, "A1");
  wheel.plug_in();
  const auto refused = driver.configure({.period = milliseconds{1}});
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().text().find("start this program again"), std::string::npos);
  EvdevModel pad(EvdevModel::pad());
  pad.unplug();
  EvdevDriver late(pad.access(), {}, "pad0/base");
  pad.plug_in();
  EXPECT_TRUE(late.configure({.period = milliseconds{1}})) << "a game pad it can be";
}

TEST_F(EvdevDriverTest, GrabsIfConfigured) {
  use(EvdevModel::pad(), {.is_grabbed = true});
  start();
  EXPECT_TRUE(model_->is_grabbed());
  driver_->deactivate();
  EXPECT_FALSE(model_->is_grabbed());
}

TEST_F(EvdevDriverTest, LeavesNoForceWhenDestroyedWhileActive) {
  use(EvdevModel::wheel());
  start();
  ASSERT_TRUE(reaches(effort(2), {.effort = 32'767}));
  driver_.reset();
  EXPECT_EQ(model_->abandoned_count(), 0u);
  EXPECT_FALSE(model_->was_left_playing());
}

}  // namespace
}  // namespace rtpm::device_evdev
