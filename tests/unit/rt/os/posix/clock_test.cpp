#include "rtpm/rt/clock.hpp"

#include <gtest/gtest.h>
#include <pthread.h>
#include <signal.h>

#include <atomic>
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

}  // namespace
}  // namespace rtpm::rt
