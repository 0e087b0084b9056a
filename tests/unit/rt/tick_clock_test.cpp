#include "tick_clock.hpp"

#include <gtest/gtest.h>

#include <cstdint>

namespace rtpm::rt {
namespace {

/// A machine whose ticks and clock a test sets.
struct Machine {
  double ns_per_tick = 0.4;
  double ticks = 5e9;
  double ns = 7e12;

  void pass(double span_ns) noexcept {
    ns += span_ns;
    ticks += span_ns / ns_per_tick;
  }
};

/// Reads the clock as rt::now() does; counts the readings of the system's clock.
class TickClockTest : public testing::Test {
 protected:
  std::int64_t now() {
    const auto ticks = static_cast<std::uint64_t>(machine_.ticks);
    if (clock_.covers(ticks)) return clock_.time_at(ticks);
    ++read_count_;
    return clock_.anchor(ticks, static_cast<std::int64_t>(machine_.ns));
  }
  double error_ns() { return static_cast<double>(now()) - machine_.ns; }
  void run(double span_ns, double step_ns) {
    for (double passed = 0; passed < span_ns; passed += step_ns) {
      machine_.pass(step_ns);
      ASSERT_NEAR(error_ns(), 0, 2);
    }
  }

  Machine machine_;
  TickClock clock_;
  int read_count_ = 0;
};

TEST_F(TickClockTest, ReadsTheSystemsClockOncePerWindow) {
  run(10e6, 1000);
  read_count_ = 0;
  run(100e6, 1000);
  EXPECT_GE(read_count_, 99);
  EXPECT_LE(read_count_, 101);
}

TEST_F(TickClockTest, ReadsTheSystemsClockUntilTheRateIsKnown) {
  run(0.4e6, 1000);
  EXPECT_EQ(read_count_, 400);
}

TEST_F(TickClockTest, KeepsTheRateOverALongPause) {
  run(10e6, 1000);
  machine_.pass(3600e9);
  read_count_ = 0;
  run(0.9e6, 1000);
  EXPECT_EQ(read_count_, 1);
}

TEST_F(TickClockTest, FollowsASteeredRate) {
  run(10e6, 1000);
  machine_.ns_per_tick *= 1 + 100e-6;
  for (int i = 0; i < 100'000; ++i) {
    machine_.pass(1000);
    // The error is at most the change's effect in one window.
    ASSERT_NEAR(error_ns(), 0, 102);
  }
  run(10e6, 1000);
}

TEST_F(TickClockTest, DistrustsTicksThatJumped) {
  // The machine slept: its ticks advanced, its clock did not. Then the ticks restarted.
  for (const double ticks : {machine_.ticks + 1e11, 1000.0}) {
    run(10e6, 1000);
    machine_.ticks = ticks;
    read_count_ = 0;
    run(10e6, 1000);
    EXPECT_GT(read_count_, 100) << "until it knows the rate again";
  }
}

TEST_F(TickClockTest, ReadsTheSystemsClockWithoutASteadyRate) {
  for (int i = 0; i < 1000; ++i) {
    machine_.ns_per_tick = i % 2 == 0 ? 0.4 : 0.5;
    machine_.pass(1e6);
    ASSERT_NEAR(error_ns(), 0, 2);
  }
  EXPECT_EQ(read_count_, 1000);
}

TEST_F(TickClockTest, NeverGoesBack) {
  run(10e6, 1000);
  std::int64_t last = now();
  machine_.ns_per_tick *= 1 - 200e-6;
  for (int i = 0; i < 100'000; ++i) {
    machine_.pass(100);
    const std::int64_t next = now();
    ASSERT_GE(next, last);
    last = next;
  }
  EXPECT_GE(clock_.tell(last - 1000), last);
}

}  // namespace
}  // namespace rtpm::rt
