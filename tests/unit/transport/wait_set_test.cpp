#include "rtpm/transport/wait_set.hpp"

#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <memory>
#include <optional>
#include <random>
#include <thread>
#include <utility>
#include <vector>

#include "rtpm/rt/budget.hpp"
#include "rtpm/rt/clock.hpp"
#include "wait_set_suite.hpp"

namespace rtpm::transport {
namespace {

using namespace test;
using namespace std::chrono_literals;

TEST_P(WaitSetTest, ReportsNothingIfNothingIsReady) {
  EXPECT_EQ(poll(), Tags{});
}

TEST_P(WaitSetTest, DoesNotEndBeforeItsTime) {
  for (const Duration span : {1ns, 300'000ns, 3'000'000ns}) {
    const MonotonicTime until = rt::now() + span;
    EXPECT_EQ(wait(until), Tags{});
    EXPECT_GE(rt::now(), until);
  }
  EXPECT_EQ(wait(rt::now() - 1h), Tags{});
}

TEST_P(WaitSetTest, ReportsManyRingsOnce) {
  for (int i = 0; i < 3; ++i)
    set_->ring();
  EXPECT_EQ(await_some(), tags_of({kDoorbell}));
  drain();
  EXPECT_EQ(poll(), Tags{});
  set_->ring();
  EXPECT_EQ(poll(), tags_of({kDoorbell}));
  EXPECT_EQ(poll(), Tags{});
}

TEST_P(WaitSetTest, EndsWhenAnotherThreadRings) {
  std::thread other([this] { set_->ring(); });
  EXPECT_EQ(await_some(), tags_of({kDoorbell}));
  other.join();
}

// Rings at any offset into a wait, each after the previous one was heard. RTPM_RINGS sets how many.
TEST_P(WaitSetTest, ReportsEachOfManyRandomRings) {
  const int ring_count = ring_count_of_a_run();
  std::atomic<int> heard_count = 0;
  std::thread other([&] {
    std::minstd_rand random(7);
    for (int i = 0; i < ring_count; ++i) {
      const MonotonicTime begin = rt::now() + std::chrono::microseconds{random() % 60};
      while (rt::now() < begin) {
      }
      if (caller_ && i % 3 == 0) {
        EXPECT_TRUE(caller_->send(Bytes(48)));
      }
      set_->ring();
      while (heard_count <= i)
        std::this_thread::yield();
    }
  });
  int lost_count = 0;
  int overslept_count = 0;
  const std::uint64_t rung = kDoorbell.raw();
  while (heard_count < ring_count) {
    const MonotonicTime begin = rt::now();
    const Tags tags = wait(begin + 5s);
    const Duration spent = rt::now() - begin;
    if (spent >= 4s) ++lost_count;
    if (spent >= kBlockTime) ++overslept_count;
    drain();
    if (std::ranges::find(tags, rung) != tags.end()) ++heard_count;
  }
  other.join();
  EXPECT_EQ(lost_count, 0);
  EXPECT_LT(overslept_count, ring_count / 10) << "rings were reported only after a receive ended";
}

// Neither side misses the other: one pushes, then reads the flag; the other sets the flag, then
// checks for pushes. Ten times RTPM_RINGS.
TEST_P(WaitSetTest, LosesNoPushToAWaiterThatAnnouncesItsSleep) {
  const int push_count = 10 * ring_count_of_a_run();
  std::atomic<int> pushed = 0;
  std::atomic<bool> is_asleep = false;
  std::thread other([&] {
    for (int i = 0; i < push_count; ++i) {
      pushed.fetch_add(1);
      if (is_asleep.exchange(false)) set_->ring();
    }
  });
  int lost_count = 0;
  for (int taken = 0; taken < push_count;) {
    taken = pushed;
    is_asleep = true;
    if (pushed == taken && taken < push_count) {
      const MonotonicTime end = rt::now() + 5s;
      while (pushed == taken && rt::now() < end)
        static_cast<void>(wait(end));
      if (pushed == taken) ++lost_count;
    }
    is_asleep = false;
    drain();
  }
  other.join();
  EXPECT_EQ(lost_count, 0);
}

TEST_P(WaitSetTest, ReportsALevelSourceWhileItCanBeRead) {
  auto [near, far] = stream_pair();
  const SourceTag tag(kSocket, 7);
  ASSERT_TRUE(set_->add(near.number(), tag, Trigger::kLevel));
  EXPECT_EQ(poll(), Tags{});
  write_all(far, Bytes(1));
  EXPECT_EQ(await_some(), tags_of({tag}));
  EXPECT_EQ(poll(), tags_of({tag})) << "it still can";
  std::byte byte{};
  ASSERT_EQ(recv(near.number(), &byte, 1, 0), 1);
  EXPECT_EQ(poll(), Tags{});
  set_->remove(near.number());
}

TEST_P(WaitSetTest, ReportsADisconnectedPeer) {
  auto [near, far] = stream_pair();
  ASSERT_TRUE(set_->add(near.number(), SourceTag(kSocket), Trigger::kLevel));
  { const Descriptor closed = std::move(far); }
  EXPECT_EQ(await_some(), tags_of({SourceTag(kSocket)}));
  set_->remove(near.number());
}

TEST_P(WaitSetWithAPort, ReportsThePortUntilItsDatagramIsReceived) {
  ASSERT_TRUE(caller_->send(Bytes(48)));
  EXPECT_EQ(await_some(), tags_of({SourceTag(kPort)}));
  EXPECT_EQ(poll(), tags_of({SourceTag(kPort)}));
  EXPECT_TRUE(receive());
  EXPECT_FALSE(receive()) << "there was one";
  EXPECT_EQ(poll(), Tags{});
  set_->ring();
  ASSERT_TRUE(caller_->send(Bytes(48)));
  bool has_heard = false;
  bool has_received = false;
  while (!has_heard || !has_received) {
    for (const std::uint64_t tag : await_some())
      (tag == kDoorbell.raw() ? has_heard : has_received) = tag == kDoorbell.raw() || receive();
  }
}

TEST_P(WaitSetTest, ReportsMoreSourcesThanFitInTurn) {
  constexpr std::uint32_t kCount = 20;
  std::vector<std::pair<Descriptor, Descriptor>> pairs;
  for (std::uint32_t i = 0; i < kCount; ++i) {
    pairs.push_back(stream_pair());
    ASSERT_TRUE(set_->add(pairs.back().first.number(), SourceTag(kSocket, i), Trigger::kLevel));
    write_all(pairs.back().second, Bytes(1));
  }
  for (const std::size_t capacity : {1u, 3u}) {
    Tags seen;
    for (std::size_t round = 0; round < (kCount + capacity - 1) / capacity; ++round) {
      for (const std::uint64_t tag : poll(capacity))
        seen.push_back(tag);
    }
    std::ranges::sort(seen);
    EXPECT_EQ(std::ranges::unique(seen).begin() - seen.begin(), kCount) << "none waits longer";
  }
  for (const auto& pair : pairs)
    set_->remove(pair.first.number());
}

TEST_P(WaitSetTest, ReportsNoRemovedSource) {
  auto [near, far] = stream_pair();
  ASSERT_TRUE(set_->add(near.number(), SourceTag(kSocket, 0, 1), Trigger::kLevel));
  write_all(far, Bytes(1));
  set_->remove(near.number());
  EXPECT_EQ(poll(), Tags{});
  EXPECT_TRUE(set_->add(near.number(), SourceTag(kSocket, 0, 2), Trigger::kLevel));
  EXPECT_EQ(poll(), tags_of({SourceTag(kSocket, 0, 2)})) << "under its new generation only";
  set_->remove(near.number());
}

// The next descriptor reuses a closed descriptor's number at once.
TEST_P(WaitSetTest, DistinguishesDescriptorsOfOneNumber) {
  std::optional<std::pair<Descriptor, Descriptor>> pair = stream_pair();
  const int number = pair->first.number();
  ASSERT_TRUE(set_->add(number, SourceTag(kSocket, 0, 1), Trigger::kLevel));
  write_all(pair->second, Bytes(1));
  set_->remove(number);
  pair.reset();
  pair = stream_pair();
  ASSERT_EQ(pair->first.number(), number);
  EXPECT_EQ(poll(), Tags{});
  ASSERT_TRUE(set_->add(number, SourceTag(kSocket, 0, 2), Trigger::kLevel));
  EXPECT_EQ(poll(), Tags{});
  write_all(pair->second, Bytes(1));
  EXPECT_EQ(await_some(), tags_of({SourceTag(kSocket, 0, 2)}));
  set_->remove(number);
}

// A new source takes over the index of one in a batch before its turn in the batch comes.
TEST_P(WaitSetTest, DistinguishesSourcesOfOneIndexWithinABatch) {
  auto [near, far] = stream_pair();
  auto [other_near, other_far] = stream_pair();
  const SourceTag former(kSocket, 0, 1);
  const SourceTag latter(kSocket, 0, 2);
  ASSERT_TRUE(set_->add(near.number(), former, Trigger::kLevel));
  write_all(far, Bytes(1));
  write_all(other_far, Bytes(1));
  const Tags batch = await_some();
  set_->remove(near.number());
  ASSERT_TRUE(set_->add(other_near.number(), latter, Trigger::kLevel));
  EXPECT_EQ(batch, tags_of({former}));
  EXPECT_EQ(std::ranges::count(batch, latter.raw()), 0) << "the batch is not about it";
  EXPECT_EQ(poll(), tags_of({latter}));
  set_->remove(other_near.number());
}

// The thread's real-time budget recovers while it may block, and only then.
TEST_P(WaitSetTest, CreditsSleepWhileItMayBlock) {
  const MonotonicTime begin = rt::now();
  rt::RealtimeBudget& budget = rt::this_thread_budget();
  budget = rt::RealtimeBudget({.runtime = 950ms, .period = 1s}, begin);
  const MonotonicTime spent = begin + rt::RealtimeBudget::kBurst;
  static_cast<void>(poll());
  EXPECT_TRUE(budget.is_spent(spent));
  for (const MonotonicTime until = rt::now() + 5ms; rt::now() < until;)
    static_cast<void>(wait(until));
  EXPECT_FALSE(budget.is_spent(spent));
  budget = rt::RealtimeBudget{};
}

TEST_P(WaitSetWithALock, ReportsASourceAddedDuringAWait) {
  auto [near, far] = stream_pair();
  for (std::uint32_t generation = 1; generation <= 50; ++generation) {
    const SourceTag tag(kSocket, 0, generation);
    std::atomic<bool> has_begun = false;
    Tags reported;
    std::thread waiter([&] {
      has_begun = true;
      reported = await_some();
    });
    while (!has_begun)
      std::this_thread::yield();
    lock_.lock();
    ASSERT_TRUE(set_->add(near.number(), tag, Trigger::kLevel));
    write_all(far, Bytes(1));
    lock_.unlock();
    waiter.join();
    EXPECT_EQ(reported, tags_of({tag}));
    std::byte byte{};
    ASSERT_EQ(recv(near.number(), &byte, 1, 0), 1);
    lock_.lock();
    set_->remove(near.number());
    lock_.unlock();
    write_all(far, Bytes(1));
    EXPECT_EQ(poll(), Tags{});
    ASSERT_EQ(recv(near.number(), &byte, 1, 0), 1);
  }
}

TEST_P(WaitSetWithALock, ReportsNoSourceRemovedDuringAWait) {
  for (std::uint32_t generation = 1; generation <= 50; ++generation) {
    auto [near, far] = stream_pair();
    const SourceTag tag(kSocket, 0, generation);
    ASSERT_TRUE(set_->add(near.number(), tag, Trigger::kLevel));
    std::atomic<bool> has_begun = false;
    std::thread waiter([&] {
      has_begun = true;
      static_cast<void>(await_some());
    });
    while (!has_begun)
      std::this_thread::yield();
    lock_.lock();
    set_->remove(near.number());
    lock_.unlock();
    write_all(far, Bytes(1));
    set_->ring();
    waiter.join();
    const Tags later = poll();
    EXPECT_EQ(std::ranges::find(later, tag.raw()), later.end());
    drain();
    near = Descriptor{};
    std::byte byte{};
    EXPECT_LE(recv(far.number(), &byte, 1, 0), 0) << "the set holds no reference to it";
  }
}

TEST_P(WaitSetWithALock, ReleasesItOnlyIfItMayBlock) {
  const int before = lock_.unlock_count;
  EXPECT_EQ(poll(), Tags{});
  EXPECT_EQ(lock_.unlock_count - before, 1) << "the test's own";
  EXPECT_EQ(wait(rt::now() + 2ms), Tags{});
  EXPECT_EQ(lock_.unlock_count - before, 3) << "and the wait's";
}

// Goes from one source to many and back, each time with a ring and with all sources ready.
TEST_P(WaitSetTest, ReportsAllReadySourcesWhileTheyChange) {
  std::vector<std::pair<Descriptor, Descriptor>> pairs;
  const auto expect_all = [&] {
    set_->ring();
    Tags expected = tags_of({kDoorbell});
    for (std::uint32_t i = 0; i < pairs.size(); ++i)
      expected.push_back(SourceTag(kSocket, i).raw());
    Tags seen = poll(32);
    if (std::ranges::find(seen, SourceTag(kPort).raw()) != seen.end()) drain();
    std::erase(seen, SourceTag(kPort).raw());
    std::ranges::sort(expected);
    EXPECT_EQ(seen, expected);
  };
  for (std::uint32_t i = 0; i < 10; ++i) {
    if (caller_) {
      EXPECT_TRUE(caller_->send(Bytes(48)));
    }
    pairs.push_back(stream_pair());
    write_all(pairs.back().second, Bytes(1));
    ASSERT_TRUE(set_->add(pairs.back().first.number(), SourceTag(kSocket, i), Trigger::kLevel));
    expect_all();
  }
  while (!pairs.empty()) {
    set_->remove(pairs.back().first.number());
    pairs.pop_back();
    expect_all();
  }
}

TEST_P(WaitSetTest, RefusesMoreSourcesThanItsLimit) {
  EXPECT_FALSE(set_->add(-1, SourceTag(kSocket), Trigger::kLevel)) << "no descriptor";
  std::vector<std::pair<Descriptor, Descriptor>> pairs;
  bool was_refused = false;
  for (std::uint32_t i = 0; i <= kSourceCountMax && !was_refused; ++i) {
    pairs.push_back(stream_pair());
    was_refused = !set_->add(pairs.back().first.number(), SourceTag(kSocket, i), Trigger::kLevel);
  }
  EXPECT_TRUE(was_refused) << "the set is full";
  EXPECT_FALSE(set_->add(pairs.front().first.number(), SourceTag(kSocket), Trigger::kLevel));
  for (const auto& pair : pairs)
    set_->remove(pair.first.number());
}

INSTANTIATE_TEST_SUITE_P(All, WaitSetTest, testing::ValuesIn(ways(kAllKinds, {false, true})),
                         name_of);
INSTANTIATE_TEST_SUITE_P(All, WaitSetWithALock, testing::ValuesIn(ways(kAllKinds, {true})),
                         name_of);
INSTANTIATE_TEST_SUITE_P(All, WaitSetWithAPort,
                         testing::ValuesIn(ways(std::array{Kind::kPortAlone, Kind::kPortAndOthers},
                                                {false, true})),
                         name_of);
TEST(Descriptor, ClosesItsDescriptorOnce) {
  auto [near, far] = stream_pair();
  {
    Descriptor owner = std::move(near);
    EXPECT_FALSE(near.is_open());
    EXPECT_TRUE(owner.is_open());
  }
  std::byte byte{};
  EXPECT_EQ(recv(far.number(), &byte, 1, 0), 0) << "the near end is closed";
}

TEST(Wait, DistinguishesReadinessFromTime) {
  auto [near, far] = stream_pair();
  EXPECT_FALSE(wait_readable(near.number(), rt::now()));
  EXPECT_FALSE(wait_readable(near.number(), rt::now() - 1h));
  const MonotonicTime until = rt::now() + 2ms;
  EXPECT_FALSE(wait_readable(near.number(), until));
  EXPECT_GE(rt::now(), until);
  EXPECT_TRUE(wait_writable(near.number(), rt::now()));
  write_all(far, Bytes(1));
  EXPECT_TRUE(wait_readable(near.number(), kNever));
}

}  // namespace
}  // namespace rtpm::transport
