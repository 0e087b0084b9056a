#include "rtpm/transport/wait_set.hpp"

#include <gtest/gtest.h>
#include <linux/filter.h>
#include <pthread.h>
#include <signal.h>
#include <sys/eventfd.h>
#include <sys/resource.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cstdlib>
#include <memory>
#include <mutex>
#include <optional>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include "frames.hpp"
#include "os/linux/port_wait_set.hpp"
#include "rtpm/rt/budget.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/test/os.hpp"
#include "rtpm/test/syscall_counter.hpp"
#include "rtpm/transport/client_transport.hpp"
#include "rtpm/transport/tcp.hpp"

// One suite for every implementation of WaitSet, with few and many sources, with and without a
// lock.
namespace rtpm::transport {
namespace {

using namespace test;
using rtpm::test::SyscallCounter;
using namespace std::chrono_literals;

constexpr SourceKind kPort{1};
constexpr SourceKind kSocket{2};
constexpr SourceKind kIdle{3};
constexpr std::size_t kSourceCountMax = 64;

enum class Kind { kPolledFew, kPolledMany, kPolledEdge, kPortAlone, kPortAndOthers };

struct Way {
  Kind kind;
  bool is_held;
};

std::string name_of(const testing::TestParamInfo<Way>& way) {
  const std::array names{"PolledFew", "PolledMany", "PolledEdge", "PortAlone", "PortAndOthers"};
  return std::string(names.at(static_cast<std::size_t>(way.param.kind))) +
         (way.param.is_held ? "WithALock" : "");
}

/// Counts how often it was released, and records its holder.
class CountingLock final : public WaitLock {
 public:
  void lock() noexcept override {
    mutex_.lock();
    is_locked = true;
  }
  void unlock() noexcept override {
    ++unlock_count;
    is_locked = false;
    mutex_.unlock();
  }

  std::atomic<int> unlock_count = 0;
  std::atomic<bool> is_locked = false;

 private:
  std::mutex mutex_;
};

int ring_count_of_a_run() {
  const char* const text = std::getenv("RTPM_RINGS");
  return text == nullptr ? 3000 : std::atoi(text);
}

using Tags = std::vector<std::uint64_t>;

Tags tags_of(std::initializer_list<SourceTag> tags) {
  Tags raw;
  for (const SourceTag tag : tags)
    raw.push_back(tag.raw());
  std::ranges::sort(raw);
  return raw;
}

class WaitSetTest : public testing::TestWithParam<Way> {
 protected:
  void SetUp() override {
    if (has_port()) {
      open_port();
    } else {
      auto opened = WaitSet::open(kSourceCountMax);
      ASSERT_TRUE(opened);
      set_ = std::move(*opened);
    }
    if (GetParam().kind == Kind::kPolledMany) add_idle(12, Trigger::kLevel);
    if (GetParam().kind == Kind::kPolledEdge) add_idle(1, Trigger::kEdge);
    if (GetParam().kind == Kind::kPortAndOthers) add_idle(2, Trigger::kLevel);
  }
  void TearDown() override {
    if (port_) set_->remove(port_->descriptor());
  }

  [[nodiscard]] static bool has_port() {
    return GetParam().kind == Kind::kPortAlone || GetParam().kind == Kind::kPortAndOthers;
  }
  void open_port() {
    const auto listener = TcpListener::open("127.0.0.1", 0);
    ASSERT_TRUE(listener);
    auto port = UdpPort::open({.port = listener->port()});
    ASSERT_TRUE(port);
    port_.emplace(std::move(*port));
    caller_ = std::move(*open_udp_transport("127.0.0.1", listener->port(), 0));
    auto opened = WaitSet::open_for_lane(kSourceCountMax);
    ASSERT_TRUE(opened);
    ASSERT_TRUE((*opened)->add_port(*port_, buffer_, SourceTag(kPort)));
    set_ = std::move(*opened);
  }
  void add_idle(std::uint32_t count, Trigger trigger) {
    for (std::uint32_t i = 0; i < count; ++i) {
      idle_.emplace_back(eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC));
      ASSERT_TRUE(set_->add(idle_.back().number(), SourceTag(kIdle, i), trigger));
    }
  }

  /// The sorted tags of at most `capacity` ready sources.
  Tags wait(MonotonicTime until, std::size_t capacity = 16) {
    std::vector<SourceTag> ready(capacity);
    if (GetParam().is_held) lock_.lock();
    const std::size_t count = set_->wait(until, ready, GetParam().is_held ? &lock_ : nullptr);
    if (GetParam().is_held) {
      EXPECT_TRUE(lock_.is_locked) << "the lock is back";
      lock_.unlock();
    }
    Tags tags;
    for (std::size_t i = 0; i < count; ++i)
      tags.push_back(ready[i].raw());
    std::ranges::sort(tags);
    return tags;
  }
  Tags poll(std::size_t capacity = 16) { return wait(kAlready, capacity); }
  /// Waits again when a wait ends early, like a lane.
  Tags await_some() {
    Tags tags;
    for (const MonotonicTime end = rt::now() + 10s; tags.empty() && rt::now() < end;)
      tags = wait(end);
    return tags;
  }
  [[nodiscard]] bool receive() { return port_->receive(buffer_).has_value(); }
  /// Receives all pending datagrams.
  void drain() {
    while (port_ && receive()) {
    }
  }

  std::optional<UdpPort> port_;
  std::unique_ptr<ClientTransport> caller_;
  alignas(64) std::array<std::byte, Datagrams::kSizeMax> buffer_{};
  std::vector<Descriptor> idle_;
  /// For a lane's set on Linux.
  [[nodiscard]] bool only_polls() const {
    return static_cast<const PortWaitSet&>(*set_).only_polls();
  }
  std::unique_ptr<WaitSet> set_;
  CountingLock lock_;
};

class WaitSetWithALock : public WaitSetTest {};
class WaitSetWithAPort : public WaitSetTest {};
class WaitSetThatReceives : public WaitSetTest {};

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

TEST_P(WaitSetTest, ReportsAnEdgeSourceOncePerSignal) {
  const Descriptor event(eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC));
  const SourceTag tag(kSocket, 1);
  ASSERT_EQ(eventfd_write(event.number(), 1), 0);
  ASSERT_TRUE(set_->add(event.number(), tag, Trigger::kEdge));
  EXPECT_EQ(await_some(), tags_of({tag})) << "of the signal before";
  EXPECT_EQ(poll(), Tags{});
  ASSERT_EQ(eventfd_write(event.number(), 1), 0);
  EXPECT_EQ(poll(), tags_of({tag}));
  EXPECT_EQ(poll(), Tags{});
  set_->remove(event.number());
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

TEST_P(WaitSetTest, TakesOneSystemCall) {
  if (rtpm::test::kHasSanitizer) GTEST_SKIP() << "sanitizers make system calls of their own";
  constexpr int kCount = 20;
  SyscallCounter counter;
  bool may_count = false;
  std::thread watched([&] {
    counter.watch_this_thread();
    may_count = counter.may_watch();
    if (!may_count) return;
    for (int round = 0; round < 2; ++round) {
      counter.count(round == 1);
      for (int i = 0; i < kCount / 2; ++i) {
        static_cast<void>(poll());
        static_cast<void>(wait(rt::now() + 100us));
      }
    }
    counter.count(false);
  });
  watched.join();
  if (!may_count) GTEST_SKIP() << "seccomp's notifications are not to be had here";
  EXPECT_EQ(counter.total(), kCount);
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

TEST_P(WaitSetTest, SurvivesAStormOfSignals) {
  struct sigaction action {};
  action.sa_handler = [](int) {};
  struct sigaction former {};
  ASSERT_EQ(sigaction(SIGUSR1, &action, &former), 0);
  std::atomic<bool> is_over = false;
  const pthread_t waiter = pthread_self();
  std::thread storm([&] {
    while (!is_over) {
      pthread_kill(waiter, SIGUSR1);
      std::this_thread::yield();
    }
  });
  for (int i = 0; i < 20; ++i) {
    const MonotonicTime until = rt::now() + 300us;
    while (rt::now() < until)
      EXPECT_EQ(wait(until), Tags{});
    set_->ring();
    EXPECT_EQ(await_some(), tags_of({kDoorbell}));
    drain();
  }
  is_over = true;
  storm.join();
  sigaction(SIGUSR1, &former, nullptr);
}

TEST_P(WaitSetTest, RefusesMoreSourcesThanItsLimit) {
  EXPECT_FALSE(set_->add(-1, SourceTag(kSocket), Trigger::kLevel)) << "no descriptor";
  std::vector<Descriptor> events;
  bool was_refused = false;
  for (std::uint32_t i = 0; i <= kSourceCountMax && !was_refused; ++i) {
    events.emplace_back(eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC));
    was_refused = !set_->add(events.back().number(), SourceTag(kSocket, i), Trigger::kLevel);
  }
  EXPECT_TRUE(was_refused) << "the set is full";
  EXPECT_FALSE(set_->add(events.front().number(), SourceTag(kSocket), Trigger::kLevel));
  for (const Descriptor& event : events)
    set_->remove(event.number());
}

// A packet filter that drops the doorbell's datagrams delays one ring, not all.
TEST_P(WaitSetThatReceives, OnlyPollsAfterALostDoorbellDatagram) {
  std::array<sock_filter, 1> none{sock_filter{BPF_RET | BPF_K, 0, 0, 0}};
  const sock_fprog program{static_cast<unsigned short>(none.size()), none.data()};
  ASSERT_EQ(setsockopt(port_->descriptor(), SOL_SOCKET, SO_ATTACH_FILTER, &program, sizeof program),
            0);
  EXPECT_FALSE(only_polls());
  std::atomic<bool> is_over = false;
  std::thread other([&] {
    while (!is_over) {
      set_->ring();
      std::this_thread::yield();
    }
  });
  for (const MonotonicTime end = rt::now() + 10s; !only_polls() && rt::now() < end;)
    static_cast<void>(wait(end));
  is_over = true;
  other.join();
  EXPECT_TRUE(only_polls());
  static_cast<void>(poll());
  std::thread last([this] { set_->ring(); });
  EXPECT_EQ(await_some(), tags_of({kDoorbell}));
  last.join();
}

std::vector<Way> ways(std::initializer_list<Kind> kinds, std::initializer_list<bool> holds) {
  std::vector<Way> all;
  for (const Kind kind : kinds) {
    for (const bool is_held : holds)
      all.push_back({kind, is_held});
  }
  return all;
}

const auto kAllKinds = {Kind::kPolledFew, Kind::kPolledMany, Kind::kPolledEdge, Kind::kPortAlone,
                        Kind::kPortAndOthers};
INSTANTIATE_TEST_SUITE_P(All, WaitSetTest, testing::ValuesIn(ways(kAllKinds, {false, true})),
                         name_of);
INSTANTIATE_TEST_SUITE_P(All, WaitSetWithALock, testing::ValuesIn(ways(kAllKinds, {true})),
                         name_of);
INSTANTIATE_TEST_SUITE_P(All, WaitSetWithAPort,
                         testing::ValuesIn(ways({Kind::kPortAlone, Kind::kPortAndOthers},
                                                {false, true})),
                         name_of);
INSTANTIATE_TEST_SUITE_P(All, WaitSetThatReceives,
                         testing::ValuesIn(ways({Kind::kPortAlone}, {false})), name_of);

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
