#include "rtpm/transport/poller.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <thread>
#include <vector>

#include "frames.hpp"
#include "rtpm/rt/clock.hpp"

namespace rtpm::transport {
namespace {

using namespace test;
using namespace std::chrono_literals;

class PollerTest : public testing::Test {
 protected:
  void SetUp() override {
    auto opened = Poller::open();
    ASSERT_TRUE(opened) << opened.error().text;
    poller_ = std::move(*opened);
  }
  /// The tags of what is ready, sorted.
  std::vector<std::uint64_t> wait(MonotonicTime until) {
    std::array<std::uint64_t, 8> tags{};
    const std::size_t count = poller_.wait(until, tags);
    std::sort(tags.begin(), tags.begin() + static_cast<std::ptrdiff_t>(count));
    return {tags.begin(), tags.begin() + static_cast<std::ptrdiff_t>(count)};
  }
  std::vector<std::uint64_t> wait_for_one(int descriptor, MonotonicTime until) {
    std::array<std::uint64_t, 2> tags{};
    const std::size_t count = poller_.wait_for_one(descriptor, 7, until, tags);
    return {tags.begin(), tags.begin() + static_cast<std::ptrdiff_t>(count)};
  }
  std::vector<std::uint64_t> look() { return wait(Poller::kAlready); }

  Poller poller_;
};

using Tags = std::vector<std::uint64_t>;

TEST_F(PollerTest, SeesNothingWhereNothingIs) {
  EXPECT_EQ(look(), Tags{});
}

TEST_F(PollerTest, DoesNotEndBeforeItsTime) {
  for (const Duration span : {1ns, 300'000ns, 3'000'000ns}) {
    const MonotonicTime until = rt::now() + span;
    EXPECT_EQ(wait(until), Tags{});
    EXPECT_GE(rt::now(), until);
  }
  EXPECT_EQ(wait(rt::now() - 1h), Tags{});
}

TEST_F(PollerTest, HearsItsBellOnceHoweverOftenItRang) {
  poller_.ring();
  poller_.ring();
  poller_.ring();
  EXPECT_EQ(wait(kNever), Tags{Poller::kBell});
  EXPECT_EQ(look(), Tags{});
  poller_.ring();
  EXPECT_EQ(look(), Tags{Poller::kBell});
}

TEST_F(PollerTest, IsWokenByAnotherThreadsRing) {
  std::thread ringer([this] { poller_.ring(); });
  EXPECT_EQ(wait(kNever), Tags{Poller::kBell});
  ringer.join();
}

TEST_F(PollerTest, ReportsASocketWhileItCanBeRead) {
  auto [near, far] = stream_pair();
  ASSERT_TRUE(poller_.add(near.number(), 7));
  EXPECT_EQ(look(), Tags{});
  write_all(far, Bytes(1));
  EXPECT_EQ(wait(kNever), Tags{7});
  EXPECT_EQ(look(), Tags{7}) << "it still can";
  std::byte byte{};
  ASSERT_EQ(recv(near.number(), &byte, 1, 0), 1);
  EXPECT_EQ(look(), Tags{});
}

TEST_F(PollerTest, ReportsAPeerThatIsGone) {
  auto [near, far] = stream_pair();
  ASSERT_TRUE(poller_.add(near.number(), 7));
  { const Descriptor closed = std::move(far); }
  EXPECT_EQ(wait(kNever), Tags{7});
}

TEST_F(PollerTest, ReportsAllThatIsReady) {
  auto [first, first_far] = stream_pair();
  auto [second, second_far] = stream_pair();
  ASSERT_TRUE(poller_.add(first.number(), 0));
  ASSERT_TRUE(poller_.add(second.number(), Poller::kBell - 1));
  write_all(first_far, Bytes(1));
  write_all(second_far, Bytes(1));
  poller_.ring();
  EXPECT_EQ(wait(kNever), (Tags{0, Poller::kBell - 1, Poller::kBell}));
}

TEST_F(PollerTest, ReportsMoreThanThereIsRoomForInTurn) {
  std::vector<std::pair<Descriptor, Descriptor>> pairs;
  for (std::uint64_t tag = 0; tag < 20; ++tag) {
    pairs.push_back(stream_pair());
    ASSERT_TRUE(poller_.add(pairs.back().first.number(), tag));
    write_all(pairs.back().second, Bytes(1));
  }
  Tags seen;
  for (int round = 0; round < 20 && seen.size() < 20; ++round) {
    for (const std::uint64_t tag : look()) {
      std::byte byte{};
      if (recv(pairs[tag].first.number(), &byte, 1, 0) == 1) seen.push_back(tag);
    }
  }
  std::ranges::sort(seen);
  EXPECT_EQ(seen.size(), 20u);
}

TEST_F(PollerTest, ReportsNothingThatWasRemoved) {
  auto [near, far] = stream_pair();
  ASSERT_TRUE(poller_.add(near.number(), 7));
  write_all(far, Bytes(1));
  poller_.remove(near.number());
  EXPECT_EQ(look(), Tags{});
  EXPECT_TRUE(poller_.add(near.number(), 8)) << "it can be added again";
  EXPECT_EQ(look(), Tags{8});
}

TEST_F(PollerTest, WaitsForOneThatWasNotAdded) {
  auto [near, far] = stream_pair();
  auto [added, other] = stream_pair();
  ASSERT_TRUE(poller_.add(added.number(), 3));
  write_all(other, Bytes(1));
  EXPECT_EQ(wait_for_one(near.number(), Poller::kAlready), Tags{}) << "and for nothing else";
  const MonotonicTime until = rt::now() + 3ms;
  EXPECT_EQ(wait_for_one(near.number(), until), Tags{});
  EXPECT_GE(rt::now(), until);
  write_all(far, Bytes(1));
  EXPECT_EQ(wait_for_one(near.number(), kNever), Tags{7});
  poller_.ring();
  EXPECT_EQ(wait_for_one(near.number(), kNever), (Tags{7, Poller::kBell}));
  EXPECT_EQ(wait_for_one(near.number(), kNever), Tags{7}) << "the bell rang once";
  EXPECT_EQ(look(), Tags{3});
}

TEST_F(PollerTest, RefusesWhatIsNoDescriptor) {
  EXPECT_FALSE(poller_.add(-1, 1));
}

TEST(Descriptor, ClosesWhatItOwnsOnce) {
  auto [near, far] = stream_pair();
  {
    Descriptor owner = std::move(near);
    EXPECT_FALSE(near.is_open());
    EXPECT_TRUE(owner.is_open());
  }
  std::byte byte{};
  EXPECT_EQ(recv(far.number(), &byte, 1, 0), 0) << "the near end is closed";
}

TEST(Wait, TellsReadinessFromTime) {
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
