#include "rtpm/rt/clock.hpp"

#include <gtest/gtest.h>
#include <pthread.h>
#include <signal.h>

#include <atomic>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <thread>

#include "rtpm/rt/host.hpp"
#include "rtpm/test/os.hpp"

namespace rtpm::rt {
namespace {

using namespace std::chrono_literals;

MonotonicTime system_time() {
  timespec time{};
  clock_gettime(CLOCK_MONOTONIC, &time);
  return time_from_ns(time.tv_sec * 1'000'000'000 + time.tv_nsec);
}

TEST(Clock, IsTheSystemsMonotonicOne) {
  constexpr Duration kTolerance = 100ns;
  // Runs longer than the clock relies on one reading of the system's clock.
  for (const MonotonicTime end = system_time() + 20ms; system_time() < end;) {
    const MonotonicTime before = system_time();
    const MonotonicTime between = now();
    const MonotonicTime after = system_time();
    ASSERT_LE(before - kTolerance, between);
    ASSERT_LE(between, after + kTolerance);
  }
}

TEST(SleepUntil, DoesNotEndBeforeItsTime) {
  for (const Duration span : {1ns, 100'000ns, 2'000'000ns}) {
    const MonotonicTime end = now() + span;
    sleep_until(end);
    EXPECT_GE(now(), end);
  }
}

TEST(SleepUntil, ReturnsWhenItsTimeHasPassed) {
  sleep_until(now() - 1h);
  sleep_until(time_from_ns(0));
  sleep_until(MonotonicTime::min());
  EXPECT_GT(now(), time_from_ns(0)) << "and it ended";
}

void do_nothing(int) {}

TEST(SleepUntil, ContinuesAfterSignals) {
  struct sigaction action {};
  action.sa_handler = do_nothing;
  struct sigaction former {};
  sigaction(SIGUSR1, &action, &former);
  std::atomic<bool> has_begun{false};
  std::atomic<bool> has_ended{false};
  const MonotonicTime end = now() + 50ms;
  bool is_early = true;
  std::thread sleeper([&] {
    has_begun = true;
    sleep_until(end);
    is_early = now() < end;
    has_ended = true;
  });
  ASSERT_TRUE(test::await([&] { return has_begun.load(); }));
  while (!has_ended) {
    pthread_kill(sleeper.native_handle(), SIGUSR1);
    sleep_until(now() + 1ms);
  }
  sleeper.join();
  sigaction(SIGUSR1, &former, nullptr);
  EXPECT_FALSE(is_early);
}

// hp-4.1-7
TEST(Host, DerivesItsClockDomainFromBootAndTimeNamespace) {
  const auto bytes_in = [](const char* path) {
    std::ifstream file(path);
    return std::string(std::istreambuf_iterator<char>(file), {});
  };
  std::error_code error;
  const std::string space = std::filesystem::read_symlink("/proc/self/ns/time", error).string();
  const std::string boot = bytes_in("/proc/sys/kernel/random/boot_id");
  EXPECT_EQ(boot.size(), 37u) << "with the line feed";
  EXPECT_EQ(clock_domain(), clock_domain_of(boot, space));
  EXPECT_NE(clock_domain_of(boot, space), clock_domain_of(boot, "time:[1]"));
  EXPECT_NE(clock_domain_of(boot, ""), clock_domain_of("0" + boot, ""));
}

TEST(Host, CountsTheCpusThatTheThreadMayUse) {
  EXPECT_EQ(usable_cpu_count(), static_cast<int>(test::cpus_of_this_thread().size()));
  EXPECT_EQ(usable_cpus(), test::cpus_of_this_thread());
  std::thread([] {
    cpu_set_t one;
    CPU_ZERO(&one);
    CPU_SET(static_cast<std::size_t>(test::cpus_of_this_thread().front()), &one);
    pthread_setaffinity_np(pthread_self(), sizeof one, &one);
    EXPECT_EQ(usable_cpu_count(), 1);
  }).join();
}

}  // namespace
}  // namespace rtpm::rt
