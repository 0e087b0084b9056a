#include <gtest/gtest.h>
#include <linux/input.h>
#include <unistd.h>

#include <functional>
#include <thread>

#include "emulated_node.hpp"
#include "opened_driver.hpp"
#include "rtpm/device_evdev/open.hpp"
#include "rtpm/rt/clock.hpp"
#include "umockdev.hpp"

/// The driver as a user opens it, with the real libevdev and libudev, before the model's node.
namespace rtpm::device_evdev {
namespace {

using driver::CommandMode;
using driver::ExchangeStatus;
using std::chrono::milliseconds;
using test::EmulatedNode;
using test::EvdevModel;

class EvdevNodeTest : public OpenedDriver {
 protected:
  void SetUp() override {
    if (const std::string obstacle = test::umockdev_obstacle(); !obstacle.empty())
      GTEST_SKIP() << obstacle;
  }
  void use(const Capabilities& capabilities, std::string_view arguments) {
    model_ = std::make_unique<EvdevModel>(capabilities);
    node_ = std::make_unique<EmulatedNode>(*model_);
    auto opened = open(arguments, "wheel0");
    ASSERT_TRUE(opened) << opened.error().text();
    driver_ = std::move(*opened);
  }
  void TearDown() override {
    OpenedDriver::TearDown();
    node_.reset();
  }

  std::unique_ptr<EvdevModel> model_;
  std::unique_ptr<EmulatedNode> node_;
};

TEST_F(EvdevNodeTest, IsFoundByEachOptionAndByProbe) {
  for (const char* words :
       {"", "serial=A1", "path=usb-0:1", "node=/dev/input/event5", "name=Model Racing Wheel"}) {
    use(EvdevModel::wheel(), words);
    EXPECT_EQ(driver_->describe().serial, "A1");
    EXPECT_EQ(driver_->describe().frame, "wheel0/base");
    EXPECT_EQ(driver_->describe().model, "Model Racing Wheel");
    EXPECT_EQ(driver_->describe().joints.size(), 1u);
    EXPECT_TRUE(driver_->configure({.period = milliseconds{1}})) << words;
    TearDown();
  }
  use(EvdevModel::pad(), "");
  const auto found = probe();
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0].driver, "evdev");
  EXPECT_EQ(found[0].model, "Model Pad");
  EXPECT_EQ(found[0].arguments, "node=/dev/input/event5");
  EXPECT_EQ(found[0].missing_right, "");
  EXPECT_NE(found[0].udev_rule.find("046d"), std::string::npos);
  EXPECT_EQ(found[0].left_out, "");
}

TEST_F(EvdevNodeTest, IsProbedWithItsInputsWithoutAChannel) {
  Capabilities pad = EvdevModel::pad();
  for (std::uint16_t code = BTN_TRIGGER_HAPPY; code < BTN_TRIGGER_HAPPY + 7; ++code)
    pad.keys.push_back(code);
  pad.absolute.push_back({.code = ABS_MISC, .minimum = 0, .maximum = 255});
  use(pad, "");
  const auto found = probe();
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0].left_out, "misc: a sample holds 8 analogs; 2 buttons: a sample holds 16");
}

TEST_F(EvdevNodeTest, HasTheKernelsRangesAndReadsItsEvents) {
  use(EvdevModel::pad(), "");
  ASSERT_EQ(driver_->describe().analogs.size(), 8u);
  start();
  const MonotonicTime before = rt::now();
  node_->send({{.type = EV_ABS, .code = ABS_Y, .value = -32'768},
               {.type = EV_KEY, .code = BTN_EAST, .value = 1},
               {.type = EV_SYN, .code = SYN_REPORT}});
  ASSERT_TRUE(exchange_until(CommandMode::kOff, 0, [&](auto) { return sample_.buttons == 2; }));
  EXPECT_EQ(sample_.analogs[1], -1);
  EXPECT_GE(sample_.host_time, before - milliseconds{1}) << "on the monotonic clock";
}

TEST_F(EvdevNodeTest, CatchesUpWithTheKernelAfterLostEvents) {
  use(EvdevModel::pad(), "");
  start();
  model_->move(ABS_X, 32'767);
  model_->press(BTN_SOUTH, true);
  node_->send({{.type = EV_SYN, .code = SYN_DROPPED}, {.type = EV_SYN, .code = SYN_REPORT}});
  bool was_marked = false;
  ASSERT_TRUE(exchange_until(CommandMode::kOff, 0, [&](auto) {
    was_marked = was_marked || sample_.faults.has(driver::Fault::kDeviceCorrupt);
    return sample_.buttons == 1;
  }));
  EXPECT_EQ(sample_.analogs[0], 1) << "no event said so";
  EXPECT_TRUE(was_marked);
}

TEST_F(EvdevNodeTest, DropsPartsOfEvents) {
  use(EvdevModel::pad(), "");
  start();
  node_->send_bytes(10);
  ASSERT_TRUE(exchange_until(CommandMode::kOff, 0, [](ExchangeStatus status) {
    return status == ExchangeStatus::kCorrupt;
  }));
  node_->send_bytes(sizeof(input_event) - 10);
  ASSERT_TRUE(exchange_until(CommandMode::kOff, 0, [](ExchangeStatus status) {
    return status == ExchangeStatus::kCorrupt;
  }));
  node_->send(
      {{.type = EV_KEY, .code = BTN_SOUTH, .value = 1}, {.type = EV_SYN, .code = SYN_REPORT}});
  EXPECT_TRUE(exchange_until(CommandMode::kOff, 0, [&](auto) { return sample_.buttons == 1; }));
}

TEST_F(EvdevNodeTest, PlaysEffectsAndErasesThem) {
  use(EvdevModel::wheel(), "gain=0.5");
  start();
  EXPECT_NEAR(model_->gain(), 0.5, 1e-4);
  EXPECT_FALSE(model_->has_autocenter());
  const auto reaches = [&](CommandMode mode, double value, const Levels& levels) {
    return exchange_until(mode, value, [&](auto) { return model_->levels() == levels; });
  };
  EXPECT_TRUE(reaches(CommandMode::kJointEffort, 1,
                      {.effort = 16'383, .spring = 32'767, .damper = 32'767}));
  EXPECT_TRUE(reaches(CommandMode::kOutputs, 0.5, {.spring = 16'383, .damper = 16'383}));
  EXPECT_TRUE(reaches(CommandMode::kOff, 0, {}));
  EXPECT_TRUE(reaches(CommandMode::kJointEffort, -2, {.effort = -32'767}));
  EXPECT_EQ(model_->new_effect_count(), 3u);
  driver_->deactivate();
  EXPECT_TRUE(model_->is_still());
  EXPECT_EQ(model_->effect_count(), 0u);
}

TEST_F(EvdevNodeTest, IsGoneWhenUnpluggedAndFoundAtAnotherNode) {
  use(EvdevModel::wheel(), "node=/dev/input/event5");
  start();
  ASSERT_TRUE(exchange_until(CommandMode::kJointEffort, 1,
                             [&](auto) { return model_->levels().effort > 0; }));
  node_->unplug();
  ASSERT_TRUE(exchange_until(CommandMode::kJointEffort, 1, [](ExchangeStatus status) {
    return status == ExchangeStatus::kGone;
  }));
  driver_->deactivate();
  const auto missing = driver_->configure({.period = milliseconds{1}});
  ASSERT_FALSE(missing);
  EXPECT_NE(missing.error().text().find("plug it in"), std::string::npos);
  model_->plug_in();
  node_->plug_in();
  start();
  EXPECT_TRUE(exchange_until(CommandMode::kJointEffort, 1,
                             [&](auto) { return model_->levels().effort > 0; }));
  EXPECT_EQ(model_->unit().node, "/dev/input/event6");
}

}  // namespace
}  // namespace rtpm::device_evdev
