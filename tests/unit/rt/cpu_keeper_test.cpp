#include "rtpm/rt/cpu_keeper.hpp"

#include <gtest/gtest.h>

#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/host.hpp"
#include "rtpm/test/os.hpp"

namespace rtpm::rt {
namespace {

using namespace std::chrono_literals;

std::unique_ptr<CpuKeeper> started_keeper() {
  auto keeper = CpuKeeper::start("test-awake", usable_cpus().front());
  EXPECT_TRUE(keeper.has_value());
  return keeper ? std::move(*keeper) : nullptr;
}

// The CPU time used in 10 ms in which this thread sleeps.
Duration used_while_asleep() {
  const Duration before = test::process_cpu_time();
  sleep_until(now() + 10ms);
  return test::process_cpu_time() - before;
}

TEST(CpuKeeper, SleepsAfterItsTimeAndWorksAgain) {
  const auto keeper = started_keeper();
  ASSERT_TRUE(keeper);
  keeper->keep_until(now() + 20ms);
  EXPECT_TRUE(test::await([&] { return used_while_asleep() < 1ms; }));
  // The keeper can be called again.
  EXPECT_TRUE(test::await([&] {
    keeper->keep_until(now() + 10ms);
    return used_while_asleep() > 2ms;
  }));
}

TEST(CpuKeeper, EndsDuringItsTime) {
  auto keeper = started_keeper();
  ASSERT_TRUE(keeper);
  keeper->keep_until(now() + 1h);
  keeper.reset();
  EXPECT_TRUE(test::await([&] { return used_while_asleep() < 1ms; }));
}

TEST(CpuKeeper, RefusesAnAbsentCpu) {
  const auto keeper = CpuKeeper::start("test-awake", 4000);
  ASSERT_FALSE(keeper.has_value());
  EXPECT_NE(keeper.error().text().find("4000"), std::string::npos) << keeper.error().text();
}

}  // namespace
}  // namespace rtpm::rt
