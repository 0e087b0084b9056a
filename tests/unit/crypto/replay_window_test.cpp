#include "rtpm/crypto/replay_window.hpp"

#include <gtest/gtest.h>

#include <random>
#include <set>

namespace rtpm::crypto {
namespace {

constexpr std::uint64_t kSize = ReplayWindow::kSize;

TEST(ReplayWindow, KeepsItsCountersAcrossAnyJump) {
  for (std::uint64_t jump = 1; jump <= 3 * kSize; ++jump) {
    ReplayWindow window;
    window.add(kSize);
    window.add(kSize + jump);
    EXPECT_FALSE(window.is_new(kSize)) << jump;
    EXPECT_EQ(window.is_new(kSize + 1), jump > 1 && jump <= kSize) << jump;
  }
}

// Compared with a set of all received counters.
TEST(ReplayWindow, AcceptsEachCounterOnceInAnyOrder) {
  std::mt19937_64 random(3);
  for (int round = 0; round < 20; ++round) {
    ReplayWindow window;
    std::set<std::uint64_t> received;
    std::uint64_t front = random() % 5000;
    for (int i = 0; i < 20'000; ++i) {
      front += random() % 3;
      if (random() % 500 == 0) front += random() % (2 * kSize);
      const std::uint64_t counter = front - std::min(front, random() % (kSize + 100));
      const std::uint64_t next = received.empty() ? 0 : *received.rbegin() + 1;
      const bool is_new =
          counter >= next || (next - counter <= kSize && !received.contains(counter));
      ASSERT_EQ(window.is_new(counter), is_new) << counter;
      if (!is_new) continue;
      window.add(counter);
      received.insert(counter);
    }
  }
}

TEST(ReplayWindow, WorksAtTheLastCounter) {
  ReplayWindow window;
  const std::uint64_t last = (std::uint64_t{1} << 48) - 1;
  window.add(last);
  EXPECT_FALSE(window.is_new(last));
  EXPECT_TRUE(window.is_new(last - 1));
  EXPECT_FALSE(window.is_new(0));
}

}  // namespace
}  // namespace rtpm::crypto
