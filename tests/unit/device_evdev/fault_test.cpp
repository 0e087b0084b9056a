#include <gtest/gtest.h>
#include <linux/input.h>

#include <cmath>
#include <set>
#include <thread>

#include "evdev_model.hpp"
#include "rtpm/device_evdev/evdev_driver.hpp"

/// Every fault of the model, starting at each of the first reads and writes, with a pad and a
/// wheel: no hang, no number out of range, no remaining force, and the right status.
namespace rtpm::device_evdev {
namespace {

using driver::ExchangeStatus;
using std::chrono::milliseconds;
using test::EvdevFault;
using test::EvdevModel;

struct Case {
  EvdevFault fault;
  std::uint64_t from;
  bool is_wheel;
};

class EvdevFaults : public testing::TestWithParam<Case> {
 protected:
  [[nodiscard]] ExchangeStatus exchange(double newton_metre) {
    driver::Command command;
    const bool is_wheel = GetParam().is_wheel;
    command.mode = is_wheel ? driver::CommandMode::kJointEffort : driver::CommandMode::kOutputs;
    command.cycle_time = model_.now();
    command.joints[0] = newton_metre;
    command.outputs = {static_cast<float>(std::abs(newton_metre)), 0.5F};
    sample_.faults = {};
    return driver_.exchange(command, sample_);
  }
  void expect_within_descriptor() {
    const driver::Descriptor descriptor = driver_.describe();
    for (std::size_t i = 0; i < descriptor.analogs.size(); ++i) {
      ASSERT_GE(sample_.analogs[i], descriptor.analogs[i].low);
      ASSERT_LE(sample_.analogs[i], descriptor.analogs[i].high);
    }
    for (std::size_t i = 0; i < descriptor.joints.size(); ++i) {
      ASSERT_GE(sample_.joints[i], descriptor.joints[i].low);
      ASSERT_LE(sample_.joints[i], descriptor.joints[i].high);
      ASSERT_TRUE(std::isfinite(sample_.joint_velocities[i]));
    }
    ASSERT_LE(sample_.host_time, model_.now());
  }
  void run(int cycle_count) {
    for (int i = 0; i < cycle_count; ++i) {
      model_.advance(milliseconds{1});
      model_.move(ABS_X, i * 100);
      model_.press(BTN_TRIGGER, i % 2 == 0);
      model_.report();
      seen_.insert(exchange(i % 7 - 3));
      if (sample_.faults.has(driver::Fault::kDeviceCorrupt)) ++lost_count_;
      expect_within_descriptor();
      std::this_thread::sleep_for(std::chrono::microseconds{60});
    }
  }
  /// Faults of reads and writes occur while the threads run; this waits for them.
  bool runs_until(ExchangeStatus status) {
    for (int i = 0; i < 400 && !seen_.contains(status); ++i)
      run(5);
    return seen_.contains(status);
  }

  EvdevModel model_{GetParam().is_wheel ? EvdevModel::wheel() : EvdevModel::pad()};
  EvdevDriver driver_{model_.access(), {}, "device/base"};
  driver::Sample sample_{};
  std::set<ExchangeStatus> seen_{};
  int lost_count_ = 0;
};

TEST_P(EvdevFaults, EndWithoutForce) {
  const EvdevFault fault = GetParam().fault;
  ASSERT_TRUE(driver_.configure({.period = milliseconds{1}}));
  model_.set_fault(fault, GetParam().from);
  const bool is_of_writes = fault == EvdevFault::kUploadFails || fault == EvdevFault::kNoSlots ||
                            fault == EvdevFault::kPlayFails || fault == EvdevFault::kGone ||
                            fault == EvdevFault::kInterrupted;
  if (const auto activated = driver_.activate(); activated) {
    run(20);
    if (fault == EvdevFault::kGone) {
      EXPECT_TRUE(runs_until(ExchangeStatus::kGone));
    }
    if (fault == EvdevFault::kShortRead || fault == EvdevFault::kGarbage) {
      EXPECT_TRUE(runs_until(ExchangeStatus::kCorrupt));
    }
    if (fault == EvdevFault::kDropped) {
      for (int i = 0; i < 400 && lost_count_ == 0; ++i)
        run(5);
      EXPECT_GT(lost_count_, 0);
    }
    if (!is_of_writes) {
      EXPECT_FALSE(seen_.contains(ExchangeStatus::kGone));
    }
  } else {
    EXPECT_TRUE(is_of_writes) << activated.error().text();
    EXPECT_FALSE(activated.error().remedy.empty());
  }
  driver_.deactivate();
  if (fault != EvdevFault::kGone) {
    EXPECT_FALSE(model_.was_left_playing());
    if (fault != EvdevFault::kEraseFails) {
      EXPECT_EQ(model_.abandoned_count(), 0u);
    }
  }
  EXPECT_TRUE(model_.is_still());

  model_.unplug();
  model_.plug_in();
  ASSERT_TRUE(driver_.configure({.period = milliseconds{1}})) << "it comes back";
  ASSERT_TRUE(driver_.activate());
  seen_.clear();
  run(3);
  EXPECT_EQ(seen_, std::set{ExchangeStatus::kOk});
}

std::vector<Case> cases() {
  std::vector<Case> all;
  for (auto fault = EvdevFault::kNone; fault <= test::kLastEvdevFault;
       fault = static_cast<EvdevFault>(static_cast<int>(fault) + 1)) {
    for (const std::uint64_t from : {0u, 1u, 2u, 3u, 5u, 8u, 13u}) {
      for (const bool is_wheel : {false, true})
        all.push_back({fault, from, is_wheel});
    }
  }
  return all;
}

INSTANTIATE_TEST_SUITE_P(Each, EvdevFaults, testing::ValuesIn(cases()), [](const auto& test) {
  return "fault" + std::to_string(static_cast<int>(test.param.fault)) + "from" +
         std::to_string(test.param.from) + (test.param.is_wheel ? "wheel" : "pad");
});

}  // namespace
}  // namespace rtpm::device_evdev
