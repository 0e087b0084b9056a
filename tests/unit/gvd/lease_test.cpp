#include "rtpm/gvd/lease.hpp"

#include <gtest/gtest.h>

#include <set>
#include <thread>
#include <vector>

namespace rtpm::gvd {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

MonotonicTime at(Duration time) {
  return MonotonicTime{seconds{1000}} + time;
}

TEST(Lease, HasOneHolderAtATime) {
  Lease lease{seconds{1}, {1, 2}};
  const auto first = lease.acquire();
  ASSERT_TRUE(first);
  EXPECT_NE(*first, Lease::kNobody);
  EXPECT_FALSE(lease.acquire());
  EXPECT_FALSE(lease.release(*first + 1)) << "only the holder gives it back";
  EXPECT_TRUE(lease.release(*first));
  EXPECT_FALSE(lease.release(*first)) << "once";
  const auto second = lease.acquire();
  ASSERT_TRUE(second);
  EXPECT_NE(*second, *first) << "the old number opens nothing";
  EXPECT_FALSE(lease.renew(*first));
}

TEST(Lease, NobodyHoldsNothing) {
  Lease lease{seconds{1}, {1, 2}};
  EXPECT_FALSE(lease.renew(Lease::kNobody));
  EXPECT_FALSE(lease.release(Lease::kNobody));
}

TEST(Lease, EndsWhenItsHolderIsSilent) {
  Lease lease{milliseconds{100}, {1, 2}};
  const auto id = lease.acquire();
  EXPECT_EQ(lease.step(at(milliseconds{0})), *id);
  EXPECT_EQ(lease.step(at(milliseconds{99})), *id);
  EXPECT_EQ(lease.step(at(milliseconds{100})), Lease::kNobody);
  EXPECT_EQ(lease.expired_count(), 1u);
  EXPECT_FALSE(lease.renew(*id)) << "it is over";
  EXPECT_TRUE(lease.acquire()) << "and free for others";
}

TEST(Lease, LastsAsLongAsItIsUsed) {
  Lease lease{milliseconds{100}, {1, 2}};
  const auto id = lease.acquire();
  for (int ms = 0; ms < 1000; ms += 90) {
    EXPECT_TRUE(lease.renew(*id));
    EXPECT_EQ(lease.step(at(milliseconds{ms})), *id);
  }
  EXPECT_EQ(lease.expired_count(), 0u);
}

TEST(Lease, AForeignTryDoesNotKeepItAlive) {
  Lease lease{milliseconds{100}, {1, 2}};
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
  Lease lease{milliseconds{100}, {1, 2}};
  const auto first = lease.acquire();
  static_cast<void>(lease.step(at(milliseconds{0})));
  EXPECT_TRUE(lease.release(*first));
  const auto second = lease.acquire();
  EXPECT_EQ(lease.step(at(milliseconds{99})), *second);
  EXPECT_EQ(lease.step(at(milliseconds{198})), *second);
  EXPECT_EQ(lease.step(at(milliseconds{199})), Lease::kNobody);
}

TEST(Lease, IsTakenAway) {
  Lease lease{seconds{1}, {1, 2}};
  const auto id = lease.acquire();
  lease.revoke();
  EXPECT_EQ(lease.holder(), Lease::kNobody);
  EXPECT_FALSE(lease.renew(*id));
  EXPECT_EQ(lease.expired_count(), 0u);
}

TEST(Lease, NumbersOfDifferentKeysDiffer) {
  std::set<std::uint64_t> numbers;
  for (std::uint64_t key = 0; key < 100; ++key) {
    Lease lease{seconds{1}, {key, ~key}};
    numbers.insert(*lease.acquire());
  }
  EXPECT_EQ(numbers.size(), 100u);
}

TEST(Lease, GoesToOneOfManyThreads) {
  for (int round = 0; round < 50; ++round) {
    Lease lease{seconds{1}, {1, static_cast<std::uint64_t>(round)}};
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

}  // namespace
}  // namespace rtpm::gvd
