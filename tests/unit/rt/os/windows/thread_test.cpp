#include "rtpm/rt/thread.hpp"

#include <gtest/gtest.h>

#include <windows.h>

#include <chrono>
#include <cstdint>
#include <string>

#include "rtpm/rt/clock.hpp"
#include "seen.hpp"

namespace rtpm::rt {
namespace {

TEST(Thread, MayHaveANameThatIsCutWithinACharacter) {
  // The 15th byte begins a character of two.
  const std::string name = seen_by({.name = "lane-of-the-ar\xc3\xa4m"}).name;
  EXPECT_EQ(name.substr(0, 14), "lane-of-the-ar");
}

/// How many handles there are, roughly: the system reuses their numbers, which are four apart.
std::uintptr_t handle_count() {
  const HANDLE event = CreateEventW(nullptr, FALSE, FALSE, nullptr);
  CloseHandle(event);
  return reinterpret_cast<std::uintptr_t>(event) / 4;
}

// Each thread that sleeps has a timer of the system.
TEST(Thread, LeavesNoHandles) {
  const auto run_one = [] {
    const auto thread = Thread::start({.name = "sleeper", .priority = 20'000},
                                      [] { sleep_until(now() + std::chrono::microseconds{1}); });
    EXPECT_TRUE(thread);
  };
  run_one();
  const std::uintptr_t before = handle_count();
  constexpr std::uintptr_t kThreadCount = 50;
  for (std::uintptr_t i = 0; i < kThreadCount; ++i)
    run_one();
  EXPECT_LT(handle_count(), before + kThreadCount / 2);
}

}  // namespace
}  // namespace rtpm::rt
