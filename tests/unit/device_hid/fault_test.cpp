#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <thread>

#include "rtpm/device_hid/hid_driver.hpp"
#include "scripted_hid.hpp"

/// Every fault starting at every step of the conversation, with every kind of device.
namespace rtpm::device_hid {
namespace {

using driver::ExchangeStatus;
using std::chrono::milliseconds;
using test::HidFault;

struct Subject {
  std::size_t kind = 0;
  bool is_bluetooth = false;
};

class HidFaultTest : public testing::TestWithParam<std::tuple<int, HidFault>> {
 protected:
  static Subject subject() {
    constexpr std::array kSubjects{Subject{0},       Subject{1},       Subject{2}, Subject{3},
                                   Subject{2, true}, Subject{3, true}, Subject{4}};
    return kSubjects.at(static_cast<std::size_t>(std::get<0>(GetParam())));
  }
  static HidFault fault() { return std::get<1>(GetParam()); }
  /// Whether devices of this kind send reports continuously.
  static bool is_streaming() { return subject().kind >= 2; }
};

/// Reads and commands until the device is gone, or for a while of its time.
/// @return the last status
ExchangeStatus use(HidDriver& driver, test::ScriptedHidPort& port, bool& was_corrupt,
                   bool& was_late) {
  driver::Sample sample;
  MonotonicTime now{std::chrono::seconds{1000}};
  const MonotonicTime end = port.now() + milliseconds{1200};
  ExchangeStatus status = ExchangeStatus::kOk;
  bool is_last = false;
  bool is_moved = false;
  int move_count = 0;
  MonotonicTime moved_at{};
  while (!is_last && status != ExchangeStatus::kGone) {
    is_last = port.now() >= end && move_count >= 20;
    // A device that reports changes only must come to rest, or its time would stop.
    if (port.now() > moved_at + milliseconds{10}) {
      moved_at = port.now();
      is_moved = !is_moved;
      ++move_count;
      port.with_model([&](test::HidModel& model) {
        model.move(0, is_moved ? 0.5 : -0.5);
        return model.press(1, is_moved), 0;
      });
    }
    driver::Command command;
    command.mode = driver::CommandMode::kJointEffort;
    command.cycle_time = now += milliseconds{1};
    command.outputs.fill(0.75F);
    command.joints[0] = 1;
    const driver::Sample before = sample;
    status = driver.exchange(command, sample);
    was_corrupt = was_corrupt || status == ExchangeStatus::kCorrupt;
    was_late = was_late || status == ExchangeStatus::kLate;
    for (const float analog : sample.analogs)
      EXPECT_TRUE(std::isfinite(analog) && std::abs(analog) <= 1);
    EXPECT_TRUE(std::isfinite(sample.joints[0]) && std::isfinite(sample.joint_velocities[0]));
    if (status != ExchangeStatus::kOk) {
      EXPECT_EQ(sample.analogs, before.analogs);
      EXPECT_EQ(sample.buttons, before.buttons);
    }
    std::this_thread::sleep_for(std::chrono::microseconds{50});
  }
  return status;
}

TEST_P(HidFaultTest, IsSurvivedAtEachStep) {
  for (const std::uint64_t from : {0u, 1u, 2u, 3u, 5u, 8u, 13u}) {
    SCOPED_TRACE(testing::Message() << "from step " << from);
    const auto system = test::system_with(test::make_model(subject().kind, subject().is_bluetooth));
    const auto port = system->plugged[0].port;
    port->set_fault(fault(), from);
    auto made = HidDriver::create(system, {.torque_newton_metre = 2}, "pad0");
    ASSERT_TRUE(made);
    HidDriver& driver = **made;
    const auto configured = driver.configure({.period = milliseconds{1}});
    if (!configured) {
      EXPECT_GT(configured.error().text().size(), 20u);
      EXPECT_FALSE(driver.activate());
      EXPECT_NE(fault(), HidFault::kNone);
      EXPECT_NE(fault(), HidFault::kStuckButton);
    } else {
      ASSERT_TRUE(driver.activate());
      bool was_corrupt = false;
      bool was_late = false;
      const ExchangeStatus last = use(driver, *port, was_corrupt, was_late);
      const bool is_silent = fault() == HidFault::kSilent || fault() == HidFault::kGarbage;
      if (fault() == HidFault::kUnplugged || (is_silent && is_streaming())) {
        EXPECT_EQ(last, ExchangeStatus::kGone);
      }
      if (is_silent && is_streaming()) {
        EXPECT_TRUE(was_late || was_corrupt || last == ExchangeStatus::kGone);
      }
      const bool is_cut = fault() == HidFault::kShort || fault() == HidFault::kLong ||
                          fault() == HidFault::kGlued || fault() == HidFault::kSplit;
      if (is_cut) {
        EXPECT_TRUE(was_corrupt || last == ExchangeStatus::kGone);
      }
      if (fault() == HidFault::kNone) {
        EXPECT_EQ(last, ExchangeStatus::kOk);
        EXPECT_FALSE(was_corrupt || was_late);
      }
      if (fault() == HidFault::kFlipped && subject().is_bluetooth) {
        EXPECT_TRUE(was_corrupt || last == ExchangeStatus::kGone);
      }
    }
    // deactivate() stops a device that still accepts reports.
    const bool listens = fault() != HidFault::kUnplugged && fault() != HidFault::kRefuses;
    driver.deactivate();
    if (listens) {
      EXPECT_TRUE(port->with_model([](test::HidModel& model) { return model.is_safe(); }));
    }
    // After the fault the device works again.
    port->set_fault(HidFault::kNone);
    ASSERT_TRUE(driver.configure({.period = milliseconds{1}}));
    ASSERT_TRUE(driver.activate());
    driver::Sample sample;
    EXPECT_EQ(driver.exchange({}, sample), ExchangeStatus::kOk);
    driver.deactivate();
    EXPECT_TRUE(port->with_model([](test::HidModel& model) { return model.is_safe(); }));
  }
}

std::vector<HidFault> faults() {
  std::vector<HidFault> all;
  for (int i = 0; i <= static_cast<int>(test::kLastHidFault); ++i)
    all.push_back(static_cast<HidFault>(i));
  return all;
}
INSTANTIATE_TEST_SUITE_P(Kinds, HidFaultTest,
                         testing::Combine(testing::Range(0, 7), testing::ValuesIn(faults())));

}  // namespace
}  // namespace rtpm::device_hid
