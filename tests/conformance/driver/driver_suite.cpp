#include "driver_suite.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <tuple>

#include "cycle.hpp"
#include "drivers.hpp"
#include "rtpm/driver_host/check.hpp"
#include "rtpm/rt/memory.hpp"
#include "rtpm/test/alloc_guard.hpp"

namespace rtpm::driver_host {

void PrintTo(const DriverCheck& check, std::ostream* out) {
  *out << check.name;
}

}  // namespace rtpm::driver_host

/// The promises of rtpm/driver/driver.hpp, on a simulated time line: the checks that
/// `rtpm-deviced --check` runs on a plug-in, and those that need access to RTPM's internals.
namespace rtpm::test {
namespace {

using driver::Command;
using driver::CommandMode;
using driver::Sample;
using driver::Vector3;
using driver_host::DriverCheck;
using std::chrono::milliseconds;

constexpr Duration kPeriod = milliseconds{1};

double length(const Vector3& v) {
  return std::hypot(v.x, v.y, v.z);
}

class DriverPromise : public ::testing::TestWithParam<std::tuple<DriverUnderTest, DriverCheck>> {};

TEST_P(DriverPromise, IsKept) {
  class Maker final : public driver_host::DriverMaker {
   public:
    [[nodiscard]] expected<std::unique_ptr<driver::Driver>, SetupError> make() override {
      return std::get<DriverUnderTest>(GetParam()).make();
    }
  } maker;
  const auto breaches = driver_host::run_check(std::get<DriverCheck>(GetParam()), maker, kPeriod,
                                               driver_host::CheckPace::kSimulated);
  for (const std::string& breach : breaches)
    ADD_FAILURE() << breach;
}

std::vector<DriverCheck> all_checks() {
  const auto checks = driver_host::driver_checks();
  return {checks.begin(), checks.end()};
}

INSTANTIATE_TEST_SUITE_P(Drivers, DriverPromise,
                         ::testing::Combine(::testing::ValuesIn(drivers_under_test()),
                                            ::testing::ValuesIn(all_checks())),
                         [](const auto& test) {
                           return std::get<0>(test.param).name + "_" + std::get<1>(test.param).name;
                         });

class DriverConformance : public ::testing::TestWithParam<DriverUnderTest> {
 protected:
  void SetUp() override { driver_ = GetParam().make(); }

  void start() {
    const auto configured = driver_->configure({.period = kPeriod});
    ASSERT_TRUE(configured) << configured.error().text();
    const auto activated = driver_->activate();
    ASSERT_TRUE(activated) << activated.error().text();
  }
  void exchange(CommandMode mode, const driver::Wrench& wrench) {
    now_ += kPeriod;
    Command command;
    command.mode = mode;
    command.sequence = ++sequence_;
    command.cycle_time = now_;
    command.deadline = now_ + 30 * kPeriod;
    command.wrench = wrench;
    sample_.faults = {};
    static_cast<void>(driver_->exchange(command, sample_));
  }

  std::unique_ptr<driver::Driver> driver_;
  Sample sample_{};
  MonotonicTime now_{std::chrono::seconds{1000}};
  std::uint64_t sequence_ = 0;
};

TEST_P(DriverConformance, ExchangesWithoutAllocating) {
  if (!is_alloc_guard_active()) GTEST_SKIP() << kAllocGuardInactive;
  start();
  const CountBreachesOnly counting;
  const std::uint64_t before = allocation_breach_count();
  {
    const rt::NoAllocationScope no_allocation;
    for (int i = 0; i < 1000; ++i) {
      exchange(CommandMode::kForce, {{1, 1, 1}, {}});
    }
  }
  EXPECT_EQ(allocation_breach_count(), before);
}

double product(const Vector3& a, const Vector3& b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}

/// A client that holds `lease` commands this force; returns the force that the device applied.
Vector3 push(gvd::DeviceCycle& cycle, std::uint64_t lease, std::uint32_t sequence, double newton,
             MonotonicTime now) {
  const Vector3 force{newton, newton, newton};
  static_cast<void>(cycle.submit(
      {lease, sequence, milliseconds{10}, driver::Setpoint::with_wrench({force, {}})}, now));
  cycle.run(now, 0);
  return cycle.newest()->wrench_applied.force_newton;
}

TEST_P(DriverConformance, PassesThroughNoForceWhenAnOperatorTakesItOver) {
  const double newton = driver_->describe().limits.force_newton_max / 4;
  // Switches off the wall and the guard, because no client commands their forces.
  gvd::CycleConfig config;
  config.safety = gvd::SafetyConfig::for_device(driver_->describe());
  config.safety->wall_newton_per_m = 0;
  config.safety->has_passivity_guard = false;
  gvd::DeviceCycle cycle(*driver_, config, SipKey{1, 2});
  ASSERT_TRUE(cycle.begin(now_));
  const auto client = cycle.lease().acquire();
  ASSERT_TRUE(client);
  Vector3 before{};
  for (std::uint32_t i = 1; i <= 300; ++i)
    before = push(cycle, *client, i, newton, now_ += kPeriod);
  if (length(before) == 0) GTEST_SKIP() << "a device without force";

  const auto taken = cycle.take_over(cycle.config().operator_priority);
  ASSERT_TRUE(taken);
  const int ramp_cycle_count = static_cast<int>(cycle.safety().ramp / kPeriod) + 1;
  int zero_at = 0;
  for (int i = 1; i <= 300; ++i) {
    EXPECT_FALSE(cycle.submit(
        {*client, 1000, milliseconds{10}, driver::Setpoint::with_wrench({before, {}})}, now_));
    const Vector3 force =
        push(cycle, *taken, static_cast<std::uint32_t>(i), -newton, now_ += kPeriod);
    if (zero_at == 0 && length(force) == 0) zero_at = i;
    if (zero_at == 0) {
      EXPECT_GT(product(force, before), 0) << "of the former holder alone, in cycle " << i;
    } else {
      EXPECT_LE(product(force, before), 0) << "of the operator alone, in cycle " << i;
    }
  }
  EXPECT_GT(zero_at, 0);
  EXPECT_LE(zero_at, ramp_cycle_count);
  cycle.end(now_);
}

INSTANTIATE_TEST_SUITE_P(Drivers, DriverConformance, ::testing::ValuesIn(drivers_under_test()),
                         [](const auto& test) { return test.param.name; });

}  // namespace
}  // namespace rtpm::test
