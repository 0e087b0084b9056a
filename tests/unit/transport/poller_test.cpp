#include "rtpm/transport/poller.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <memory>
#include <optional>
#include <thread>
#include <vector>

#include "frames.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/transport/link.hpp"
#include "rtpm/transport/stream.hpp"
#include "rtpm/transport/tcp.hpp"
#include "side_watch.hpp"

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
    std::vector<std::uint64_t> ready(tags.begin(),
                                     tags.begin() + static_cast<std::ptrdiff_t>(count));
    std::ranges::sort(ready);
    return ready;
  }
  std::vector<std::uint64_t> look() { return wait(Poller::kAlready); }
  /// Another thread rings so often, by `ring`, each time once it was heard that it rang before;
  /// `receive` takes what came in a wait, and is told whether the bell rang in it.
  template <class Ring, class Wait, class Receive>
  static void expect_each_ring_heard(int ring_count, Ring ring, Wait wait, Receive receive) {
    std::atomic<int> heard_count = 0;
    std::thread other([&] {
      for (int i = 0; i < ring_count; ++i) {
        ring(i);
        while (heard_count <= i)
          std::this_thread::yield();
      }
    });
    int overslept_count = 0;
    while (heard_count < ring_count) {
      const MonotonicTime begin = rt::now();
      const std::vector<std::uint64_t> tags = wait();
      if (rt::now() - begin >= kBlockTime) ++overslept_count;
      const bool has_rung = std::ranges::find(tags, Poller::kBell) != tags.end();
      receive(has_rung);
      if (has_rung) ++heard_count;
    }
    other.join();
    EXPECT_LT(overslept_count, ring_count / 10) << "rings were heard when a wait was over";
  }

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

/// A port beside the poller, which knows nothing of it, and two ways to wait for it.
class PollerWithPort : public PollerTest, public testing::WithParamInterface<bool> {
 protected:
  void SetUp() override {
    PollerTest::SetUp();
    const auto listener = TcpListener::open("127.0.0.1", 0);
    ASSERT_TRUE(listener);
    auto port = UdpPort::open({.port = listener->port()});
    ASSERT_TRUE(port) << port.error().text;
    port_.emplace(std::move(*port));
    link_ = std::move(*open_udp_link("127.0.0.1", listener->port(), 0));
  }
  void send() { ASSERT_TRUE(link_->send(Bytes(48))); }
  Tags wait_for_port(MonotonicTime until) {
    std::array<std::uint64_t, 2> tags{};
    const Watched watched{port_->descriptor(), 7};
    const std::size_t count = GetParam() ? poller_.receive_for(*port_, buffer_, 7, until, tags)
                                         : poller_.wait_for({&watched, 1}, until, tags);
    return {tags.begin(), tags.begin() + static_cast<std::ptrdiff_t>(count)};
  }
  /// As a lane does, which waits again where a wait ended with nothing.
  Tags await_port() {
    Tags tags;
    while (tags.empty())
      tags = wait_for_port(kNever);
    return tags;
  }
  bool receive() { return port_->receive(buffer_).has_value(); }

  std::optional<UdpPort> port_;
  std::unique_ptr<Link> link_;
  Bytes buffer_ = Bytes(2000);
};

TEST_P(PollerWithPort, WaitsForThePortThatWasNotAdded) {
  auto [added, other] = stream_pair();
  ASSERT_TRUE(poller_.add(added.number(), 3));
  write_all(other, Bytes(1));
  EXPECT_EQ(wait_for_port(Poller::kAlready), Tags{}) << "and for nothing else";
  const MonotonicTime until = rt::now() + 3ms;
  EXPECT_EQ(wait_for_port(until), Tags{});
  EXPECT_GE(rt::now(), until) << "a short wait is as long as it should be";
  send();
  EXPECT_EQ(await_port(), Tags{7});
  EXPECT_TRUE(receive());
  EXPECT_FALSE(receive()) << "there was one";
  EXPECT_EQ(look(), Tags{3});
}

TEST_P(PollerWithPort, HearsTheBellThatRangBeforeAndOnce) {
  poller_.ring();
  EXPECT_EQ(await_port(), Tags{Poller::kBell});
  EXPECT_EQ(wait_for_port(rt::now() + 100ms), Tags{}) << "the bell rang once";
  poller_.ring();
  send();
  bool has_heard = false;
  bool has_received = false;
  while (!has_heard || !has_received) {
    for (const std::uint64_t tag : await_port())
      (tag == 7 ? has_received : has_heard) = tag != 7 || receive();
  }
}

TEST_P(PollerWithPort, HearsEachRingOfOthersWhileItWaits) {
  const auto ring = [this](int i) {
    poller_.ring();
    // Now and then a datagram comes with it, after which it waits by receiving again.
    if (i % 3 == 0) send();
  };
  const auto receive_all = [this](bool) {
    while (receive()) {
    }
  };
  expect_each_ring_heard(
      2000, ring, [this] { return wait_for_port(kNever); }, receive_all);
}

INSTANTIATE_TEST_SUITE_P(Poller, PollerWithPort, testing::Bool(), [](const auto& parameter) {
  return parameter.param ? "Receiving" : "Polling";
});

// A lane waits for its only connection beside its port; where the system has io_uring, by a
// receive.
class PollerWithConnection : public PollerTest, public testing::WithParamInterface<bool> {
 protected:
  void SetUp() override {
    PollerTest::SetUp();
    if (!GetParam()) return;
    if (SideWatch::open() == nullptr) GTEST_SKIP() << "io_uring is not to be had here";
    poller_.allow_receives();
  }
  Tags wait_for_both(MonotonicTime until) {
    std::array<std::uint64_t, 3> tags{};
    const Watched other{other_.first.number(), 7};
    const std::size_t count = poller_.receive_for(stream_, 5, other, until, tags);
    Tags ready(tags.begin(), tags.begin() + static_cast<std::ptrdiff_t>(count));
    std::ranges::sort(ready);
    return ready;
  }
  Tags await_any() {
    Tags tags;
    while (tags.empty())
      tags = wait_for_both(kNever);
    return tags;
  }
  void send() { write_all(far_, frame_of(48)); }
  bool receive() { return stream_.receive().has_value(); }
  /// Until it waits by receiving, where it does.
  void be_alone() {
    for (int i = 0; i < Poller::kAloneMin + 2; ++i) {
      send();
      ASSERT_EQ(await_any(), Tags{5});
      ASSERT_TRUE(receive());
      ASSERT_FALSE(receive()) << "there was one";
    }
  }

  std::pair<Descriptor, Descriptor> other_ = stream_pair();
  std::pair<Descriptor, Descriptor> ends_ = stream_pair();
  Descriptor& far_ = ends_.second;
  FrameStream stream_{std::move(ends_.first), 1000};
};

TEST_P(PollerWithConnection, WaitsForTheConnectionTheOtherAndTheBell) {
  for (int round = 0; round < 3; ++round) {
    be_alone();
    write_all(other_.second, Bytes(1));
    EXPECT_EQ(await_any(), Tags{7});
    EXPECT_EQ(wait_for_both(Poller::kAlready), Tags{7}) << "while it can be read";
    std::byte byte{};
    EXPECT_EQ(recv(other_.first.number(), &byte, 1, 0), 1);
    be_alone();
    poller_.ring();
    EXPECT_EQ(await_any(), Tags{Poller::kBell});
    EXPECT_EQ(wait_for_both(rt::now() + 100ms), Tags{}) << "the bell rang once";
  }
}

TEST_P(PollerWithConnection, WaitsAsLongAsItIsTold) {
  be_alone();
  EXPECT_EQ(wait_for_both(Poller::kAlready), Tags{});
  const MonotonicTime until = rt::now() + 3ms;
  EXPECT_EQ(wait_for_both(until), Tags{});
  EXPECT_GE(rt::now(), until);
}

TEST_P(PollerWithConnection, GivesWhatComesInPieces) {
  be_alone();
  const Bytes frame = frame_of(48);
  write_all(far_, ConstBytes(frame).first(10));
  EXPECT_EQ(await_any(), Tags{5});
  EXPECT_FALSE(receive());
  write_all(far_, ConstBytes(frame).subspan(10));
  EXPECT_EQ(await_any(), Tags{5});
  EXPECT_TRUE(receive());
}

TEST_P(PollerWithConnection, TellsThatThePeerIsGone) {
  be_alone();
  far_ = Descriptor{};
  EXPECT_EQ(await_any(), Tags{5});
  const auto frame = stream_.receive();
  ASSERT_FALSE(frame);
  EXPECT_EQ(frame.error(), IoError::kClosed);
}

TEST_P(PollerWithConnection, HoldsOnToNothingAfterItsEnd) {
  be_alone();
  poller_.end_receives();
  other_.first = Descriptor{};
  std::byte byte{};
  EXPECT_EQ(recv(other_.second.number(), &byte, 1, 0), 0) << "the other end is still open";
}

TEST_P(PollerWithConnection, HearsEachRingOfOthersWhileItWaits) {
  const auto ring = [this](int i) {
    // Enough of the connection in between for a wait that receives.
    for (int call = 0; call < i % (2 * Poller::kAloneMin); ++call)
      send();
    poller_.ring();
  };
  const auto receive_some = [this](bool has_rung) {
    while (receive() && has_rung) {
    }
  };
  expect_each_ring_heard(
      3000, ring, [this] { return wait_for_both(kNever); }, receive_some);
}

INSTANTIATE_TEST_SUITE_P(Poller, PollerWithConnection, testing::Bool(), [](const auto& parameter) {
  return parameter.param ? "Receiving" : "Polling";
});

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
