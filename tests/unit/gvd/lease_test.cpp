#include "rtpm/gvd/command_lease.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <set>
#include <string_view>
#include <thread>
#include <vector>

namespace rtpm::gvd {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

MonotonicTime at(Duration time) {
  return MonotonicTime{seconds{1000}} + time;
}

/// A lease whose only limit is the one for silence; it changes hands once per step.
LeaseConfig silent_after(Duration silence_max) {
  return {silence_max, std::chrono::hours{1}, Duration{0}, Duration{0}};
}

TEST(Lease, HasOneHolderAtATime) {
  Lease lease{silent_after(seconds{1}), {1, 2}};
  const auto first = lease.acquire();
  ASSERT_TRUE(first);
  EXPECT_NE(*first, Lease::kNobody);
  EXPECT_FALSE(lease.acquire());
  EXPECT_FALSE(lease.release(*first + 1)) << "only the holder gives it back";
  EXPECT_TRUE(lease.release(*first));
  EXPECT_FALSE(lease.release(*first)) << "once";
  EXPECT_EQ(lease.step(at(milliseconds{1})), Lease::kNobody);
  const auto second = lease.acquire();
  ASSERT_TRUE(second);
  EXPECT_NE(*second, *first) << "the old number opens nothing";
  EXPECT_FALSE(lease.renew(*first));
}

TEST(Lease, TheNumberOfNoHolderHoldsNothing) {
  Lease lease{silent_after(seconds{1}), {1, 2}};
  EXPECT_FALSE(lease.renew(Lease::kNobody));
  EXPECT_FALSE(lease.release(Lease::kNobody));
}

TEST(Lease, LastsAsLongAsItIsRenewed) {
  Lease lease{silent_after(milliseconds{100}), {1, 2}};
  const auto id = lease.acquire();
  for (int ms = 0; ms < 1000; ms += 90) {
    EXPECT_TRUE(lease.renew(*id));
    EXPECT_EQ(lease.step(at(milliseconds{ms})), *id);
  }
  EXPECT_EQ(lease.expired_count(), 0u);
}

TEST(Lease, AForeignTryDoesNotKeepItAlive) {
  Lease lease{silent_after(milliseconds{100}), {1, 2}};
  const auto id = lease.acquire();
  EXPECT_EQ(lease.step(at(milliseconds{0})), *id);
  for (int ms = 1; ms < 100; ++ms) {
    EXPECT_FALSE(lease.acquire());
    EXPECT_FALSE(lease.renew(*id + 1));
    EXPECT_EQ(lease.step(at(milliseconds{ms})), *id);
  }
  EXPECT_EQ(lease.step(at(milliseconds{100})), Lease::kNobody);
}

TEST(Lease, ANewHolderHasItsWholeTime) {
  Lease lease{silent_after(milliseconds{100}), {1, 2}};
  const auto first = lease.acquire();
  static_cast<void>(lease.step(at(milliseconds{0})));
  EXPECT_TRUE(lease.release(*first));
  const auto second = lease.acquire();
  ASSERT_TRUE(second);
  EXPECT_EQ(lease.step(at(milliseconds{99})), *second);
  EXPECT_EQ(lease.step(at(milliseconds{198})), *second);
  EXPECT_EQ(lease.step(at(milliseconds{199})), Lease::kNobody);
}

TEST(Lease, IsTakenAway) {
  Lease lease{silent_after(seconds{1}), {1, 2}};
  const auto id = lease.acquire();
  lease.revoke();
  EXPECT_EQ(lease.holder(), Lease::kNobody);
  EXPECT_FALSE(lease.renew(*id));
  EXPECT_EQ(lease.expired_count(), 0u);
}

TEST(Lease, IsTakenOver) {
  Lease lease{{}, {1, 2}};
  const auto former = lease.acquire();
  EXPECT_EQ(lease.step(at(milliseconds{0})), *former);
  const auto next = lease.take_over();
  ASSERT_TRUE(next);
  EXPECT_NE(*next, *former);
  EXPECT_EQ(lease.holder(), *next);
  EXPECT_FALSE(lease.renew(*former));
  EXPECT_FALSE(lease.use(*former));
  EXPECT_FALSE(lease.release(*former));
  EXPECT_FALSE(lease.acquire());
  EXPECT_EQ(lease.step(at(milliseconds{1})), *next);
  EXPECT_EQ(lease.state_of(*former), LeaseState::kTakenOver);
  EXPECT_EQ(lease.state_of(*next), LeaseState::kHeld);
  EXPECT_EQ(lease.taken_over_count(), 1u);
  EXPECT_TRUE(lease.renew(*next));
}

TEST(Lease, LastsForAnOperatorAsLongAsItIsRenewed) {
  LeaseConfig config;
  config.operator_silence_max = seconds{5};
  Lease lease{config, {1, 2}};
  const auto former = lease.acquire();
  ASSERT_TRUE(former);
  const auto id = lease.take_over();
  ASSERT_TRUE(id);
  for (int s = 0; s < 3600; ++s) {
    ASSERT_TRUE(lease.renew(*id));
    ASSERT_EQ(lease.step(at(seconds{s})), *id) << s;
    ASSERT_FALSE(lease.acquire()) << "the former holder waits";
  }
  EXPECT_EQ(lease.step(at(seconds{3604} - milliseconds{1})), *id);
  EXPECT_EQ(lease.step(at(seconds{3604})), Lease::kNobody) << "silent for 5 s";
  EXPECT_EQ(lease.state_of(*id), LeaseState::kSilent);
  const auto next = lease.acquire();
  ASSERT_TRUE(next);
  EXPECT_EQ(lease.step(at(seconds{3605})), *next);
  EXPECT_EQ(lease.step(at(seconds{3606})), Lease::kNobody) << "a client again";
}

TEST(Lease, ChangesHandsNoFasterThanItsIntervalsSay) {
  Lease lease{{}, {1, 2}};
  int acquired_count = 0;
  int taken_over_count = 0;
  for (int ms = 0; ms < 10'000; ++ms) {
    for (int i = 0; i < 5; ++i) {
      if (const auto id = lease.acquire()) {
        ++acquired_count;
        EXPECT_TRUE(lease.release(*id));
      }
      if (const auto id = lease.take_over()) {
        ++taken_over_count;
        EXPECT_TRUE(lease.release(*id));
      }
    }
    static_cast<void>(lease.step(at(milliseconds{ms})));
  }
  EXPECT_GE(acquired_count, 98);
  EXPECT_LE(acquired_count, 101) << "ten times a second, and the first";
  EXPECT_GE(taken_over_count, 9);
  EXPECT_LE(taken_over_count, 11) << "once a second, and the first";
}

TEST(Lease, RemembersHowTheNewestEnded) {
  Lease lease{silent_after(milliseconds{100}), {1, 2}};
  const auto silent = lease.acquire();
  static_cast<void>(lease.step(at(milliseconds{0})));
  static_cast<void>(lease.step(at(milliseconds{100})));
  const auto released = lease.acquire();
  EXPECT_TRUE(lease.release(*released));
  static_cast<void>(lease.step(at(milliseconds{101})));
  const auto lost = lease.acquire();
  lease.revoke();
  EXPECT_EQ(lease.state_of(*silent), LeaseState::kSilent);
  EXPECT_EQ(lease.state_of(*released), LeaseState::kReleased);
  EXPECT_EQ(lease.state_of(*lost), LeaseState::kDeviceLost);
  EXPECT_EQ(lease.state_of(*lost ^ 0x10000), LeaseState::kUnknown) << "an unknown number";
  EXPECT_EQ(lease.state_of(Lease::kNobody), LeaseState::kUnknown);
  for (std::size_t i = 0; i < Lease::kRememberedCount; ++i) {
    static_cast<void>(lease.step(at(milliseconds{102 + static_cast<int>(i)})));
    const auto next = lease.acquire();
    ASSERT_TRUE(next);
    EXPECT_TRUE(lease.release(*next));
  }
  EXPECT_EQ(lease.state_of(*lost), LeaseState::kUnknown) << "too many came after it";
}

TEST(Lease, NumbersOfDifferentKeysDiffer) {
  std::set<std::uint64_t> numbers;
  for (std::uint64_t key = 0; key < 100; ++key) {
    Lease lease{silent_after(seconds{1}), {key, ~key}};
    numbers.insert(*lease.acquire());
  }
  EXPECT_EQ(numbers.size(), 100u);
}

TEST(Lease, GoesToOneOfManyThreads) {
  for (int round = 0; round < 50; ++round) {
    Lease lease{silent_after(seconds{1}), {1, static_cast<std::uint64_t>(round)}};
    std::atomic<int> winner_count{0};
    std::vector<std::thread> threads;
    threads.reserve(4);
    for (int i = 0; i < 4; ++i) {
      threads.emplace_back([&] {
        if (lease.acquire()) ++winner_count;
      });
    }
    for (std::thread& thread : threads)
      thread.join();
    EXPECT_EQ(winner_count, 1);
  }
}

TEST(Lease, HasOneHolderUnderManyThreads) {
  Lease lease{silent_after(std::chrono::hours{1}), {1, 2}};
  std::atomic<bool> is_done{false};
  std::atomic<int> wrong_count{0};
  std::vector<std::thread> threads;
  threads.reserve(4);
  for (int i = 0; i < 4; ++i) {
    threads.emplace_back([&, i] {
      while (!is_done) {
        const auto id = i == 0 ? lease.take_over() : lease.acquire();
        if (!id) continue;
        const bool was_released = lease.release(*id);
        // This thread released the lease, or the first thread took it over.
        const LeaseState state = lease.state_of(*id);
        if (was_released ? state != LeaseState::kReleased && state != LeaseState::kUnknown
                         : state == LeaseState::kHeld || state == LeaseState::kReleased) {
          ++wrong_count;
        }
        if (lease.renew(*id)) ++wrong_count;
      }
    });
  }
  for (int ms = 0; ms < 20'000; ++ms)
    static_cast<void>(lease.step(at(milliseconds{ms})));
  is_done = true;
  for (std::thread& thread : threads)
    thread.join();
  EXPECT_EQ(wrong_count, 0);
}

}  // namespace
}  // namespace rtpm::gvd
