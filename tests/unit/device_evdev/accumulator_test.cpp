#include "rtpm/device_evdev/accumulator.hpp"

#include <gtest/gtest.h>
#include <linux/input.h>

#include <cmath>
#include <limits>
#include <numbers>

#include "evdev_model.hpp"

namespace rtpm::device_evdev {
namespace {

using std::chrono::milliseconds;
using test::EvdevModel;

constexpr MonotonicTime kStart{std::chrono::seconds{50}};

class EvdevAccumulator : public testing::Test {
 protected:
  explicit EvdevAccumulator(Capabilities capabilities = EvdevModel::pad())
      : capabilities_(std::move(capabilities)) {}

  void event(std::uint16_t type, std::uint16_t code, std::int32_t value) {
    accumulator_.apply({now_, type, code, value}, now_);
  }
  const State& report() {
    event(EV_SYN, SYN_REPORT, 0);
    return accumulator_.state();
  }

  Capabilities capabilities_;
  Layout layout_ = make_layout(capabilities_, {});
  MonotonicTime now_ = kStart;
  Accumulator accumulator_{layout_, capabilities_, {}, kStart};
};

class EvdevWheelAccumulator : public EvdevAccumulator {
 protected:
  EvdevWheelAccumulator() : EvdevAccumulator(EvdevModel::wheel()) {}
};

class EvdevDialAccumulator : public EvdevAccumulator {
 protected:
  EvdevDialAccumulator() : EvdevAccumulator(EvdevModel::dial()) {}
};

TEST_F(EvdevAccumulator, TakesAReportAsAWhole) {
  event(EV_ABS, ABS_X, 32'767);
  event(EV_KEY, BTN_SOUTH, 1);
  EXPECT_EQ(accumulator_.state().analogs[0], 0) << "not before its SYN_REPORT";
  EXPECT_EQ(accumulator_.state().buttons, 0u);
  now_ += milliseconds{4};
  const State& state = report();
  EXPECT_EQ(state.analogs[0], 1);
  EXPECT_EQ(state.buttons, 1u);
  EXPECT_EQ(state.time, now_);
}

TEST_F(EvdevAccumulator, BeginsWithTheStateAtOpening) {
  capabilities_.absolute[0].value = -32'768;
  capabilities_.pressed = {BTN_EAST};
  const Accumulator accumulator(layout_, capabilities_, {}, kStart);
  EXPECT_EQ(accumulator.state().analogs[0], -1);
  EXPECT_EQ(accumulator.state().buttons, 2u);
  EXPECT_EQ(accumulator.state().edges[1], 1);
}

TEST_F(EvdevAccumulator, CountsEdgesAndNotRepeats) {
  for (const int value : {1, 2, 2, 0, 1, 1, 0})
    event(EV_KEY, BTN_SOUTH, value);
  EXPECT_EQ(report().edges[0], 4) << "a press within one report is not lost";
  EXPECT_EQ(accumulator_.state().buttons, 0u);
}

TEST_F(EvdevAccumulator, KeepsItsEdgeCountsOverAReplug) {
  event(EV_KEY, BTN_SOUTH, 1);
  const State before = report();
  const Accumulator again(layout_, capabilities_, before, kStart);
  EXPECT_EQ(again.state().buttons, 0u);
  EXPECT_EQ(again.state().edges[0], 2) << "it was released meanwhile";
}

TEST_F(EvdevAccumulator, CatchesUpAfterLostEvents) {
  event(EV_ABS, ABS_X, 32'767);
  event(EV_SYN, SYN_DROPPED, 0);
  event(EV_KEY, BTN_SOUTH, 1);
  EXPECT_EQ(accumulator_.state().analogs[0], 0);
  const State& state = report();
  EXPECT_EQ(state.analogs[0], 1) << "libevdev takes it as known and does not repeat it";
  EXPECT_EQ(state.buttons, 1u);
  EXPECT_EQ(state.lost_count, 1u);
}

TEST_F(EvdevAccumulator, ClampsAndCountsValuesOutOfRange) {
  event(EV_ABS, ABS_X, 40'000);
  event(EV_ABS, ABS_RZ, -1);
  const State& state = report();
  EXPECT_EQ(state.analogs[0], 1);
  EXPECT_EQ(state.analogs[5], 0);
  EXPECT_EQ(state.clamped_count, 2u);
  EXPECT_EQ(state.corrupt_count, 0u);
}

TEST_F(EvdevAccumulator, DropsAndCountsMeaninglessEvents) {
  event(EV_ABS, 0xffff, 1);
  event(EV_REL, 0xffff, 1);
  event(EV_KEY, 0xffff, 1);
  event(EV_KEY, BTN_SOUTH, 3);
  event(EV_KEY, BTN_SOUTH, -1);
  event(0xffff, 0, 0);
  event(EV_MSC, MSC_SCAN, 12);
  event(EV_FF, 0, 1);
  event(EV_ABS, ABS_VOLUME, 1);
  const State& state = report();
  EXPECT_EQ(state.corrupt_count, 6u);
  EXPECT_EQ(state.buttons, 0u);
}

TEST_F(EvdevAccumulator, RefusesTimesThatGoBackOrLieInTheFuture) {
  accumulator_.apply({kNever, EV_SYN, SYN_REPORT, 0}, now_ + milliseconds{3});
  EXPECT_EQ(accumulator_.state().time, now_ + milliseconds{3});
  accumulator_.apply({MonotonicTime{}, EV_SYN, SYN_REPORT, 0}, now_ + milliseconds{4});
  EXPECT_EQ(accumulator_.state().time, now_ + milliseconds{3});
}

TEST_F(EvdevWheelAccumulator, HasAPositionAndAVelocity) {
  const double radians_per_count = 5 * std::numbers::pi / 65'535;
  event(EV_ABS, ABS_X, 32'768);
  report();
  for (int i = 1; i <= 5; ++i) {
    now_ += milliseconds{2};
    event(EV_ABS, ABS_X, 32'768 + 100 * i);
    report();
  }
  EXPECT_NEAR(accumulator_.state().joints[0], 500.5 * radians_per_count, 1e-9);
  EXPECT_NEAR(accumulator_.state().velocities[0], 100 * radians_per_count / 0.002, 1e-6);
  driver::Sample sample;
  fill(sample, accumulator_.state(), layout_, now_);
  EXPECT_GT(sample.joint_velocities[0], 0);
  fill(sample, accumulator_.state(), layout_, now_ + milliseconds{60});
  EXPECT_EQ(sample.joint_velocities[0], 0) << "the kernel reports motion only";
}

TEST_F(EvdevDialAccumulator, AddsTurnsUp) {
  for (int i = 0; i < 36; ++i) {
    now_ += milliseconds{10};
    event(EV_REL, REL_DIAL, 1);
    report();
  }
  EXPECT_NEAR(accumulator_.state().joints[0], 3 * std::numbers::pi, 1e-9) << "24 steps per turn";
  EXPECT_NEAR(accumulator_.state().velocities[0], 2 * std::numbers::pi / 24 / 0.01, 1e-6);
  const Accumulator again(layout_, capabilities_, accumulator_.state(), now_);
  EXPECT_NEAR(again.state().joints[0], 3 * std::numbers::pi, 1e-9) << "also when it comes back";
}

TEST_F(EvdevDialAccumulator, ClampsImpossibleSteps) {
  event(EV_REL, REL_DIAL, std::numeric_limits<std::int32_t>::min());
  const State& state = report();
  EXPECT_EQ(state.clamped_count, 1u);
  EXPECT_TRUE(std::isfinite(state.joints[0]) && std::isfinite(state.velocities[0]));
}

}  // namespace
}  // namespace rtpm::device_evdev
