#include <linux/futex.h>
#include <sys/syscall.h>

#include <array>
#include <atomic>
#include <cstring>
#include <random>
#include <thread>

#include "rtpm/transport/wait_set.hpp"
#include "rtpm/wire/limits.hpp"
#include "shared_memory_ends.hpp"

namespace rtpm::transport {
namespace {

using namespace test;
using namespace std::chrono_literals;

constexpr SourceTag kEvent(SourceKind{1}, 7);

// ---- the rings ----------------------------------------------------------------------------------

// hp-16.2-1: checked against the specification alone, in both directions.
TEST(SharedMemoryRings, HaveTheLayoutOfTheSpecification) {
  Host host;
  RawPair pair(host);
  const Bytes call = frame_of(300);
  pair.memory->write_first(call, call.size());
  expect_frame(*pair.connection, call);
  EXPECT_EQ(pair.memory->to_server_head(), 384u);
  EXPECT_EQ(pair.memory->to_server_taken(), 1u);
  const Bytes reply = frame_of(400);
  ASSERT_TRUE(pair.connection->send(reply, rt::now()));
  EXPECT_EQ(pair.memory->to_client_tail(), 512u);
  EXPECT_EQ(load_le<std::uint32_t>(pair.memory->to_client_data()), reply.size());
  EXPECT_EQ(load_le<std::uint32_t>(pair.memory->to_client_data() + 4), 1u);
  EXPECT_EQ(std::memcmp(pair.memory->to_client_data() + 8, reply.data(), reply.size()), 0);
}

// hp-16.2-1
TEST(SharedMemoryRings, StoreShortFramesInTheirSlots) {
  Host host;
  RawPair pair(host);
  const Bytes call = frame_of(48);
  pair.memory->write_to_slot(call, call.size());
  expect_frame(*pair.connection, call);
  EXPECT_EQ(pair.memory->to_server_head(), 0u);
  EXPECT_EQ(pair.memory->to_server_taken(), 1u);
  for (std::uint32_t number = 1; number <= 16; ++number) {
    const Bytes reply = frame_of(100 + number);
    ASSERT_TRUE(pair.connection->send(reply, rt::now()));
    const std::byte* const slot = pair.memory->to_client_slot(number);
    EXPECT_EQ(load_le<std::uint32_t>(slot), reply.size());
    EXPECT_EQ(load_le<std::uint32_t>(slot + 4), number);
    EXPECT_EQ(std::memcmp(slot + 8, reply.data(), reply.size()), 0);
  }
  EXPECT_EQ(pair.memory->to_client_tail(), 0u);
  ASSERT_TRUE(pair.connection->send(frame_of(100), rt::now()));
  EXPECT_EQ(pair.memory->to_client_tail(), 192u) << "none of the slots was read";
  pair.memory->to_client_taken() = 17;
  ASSERT_TRUE(pair.connection->send(frame_of(100), rt::now()));
  EXPECT_EQ(load_le<std::uint32_t>(pair.memory->to_client_slot(18) + 4), 18u);
}

// hp-16.2-2, hp-16.2-3, hp-16.2-4
TEST(SharedMemoryRings, ReportAPeerThatWritesInvalidWords) {
  const Bytes call = frame_of(48);
  for (int kind = 0; kind < 9; ++kind) {
    Host host;
    RawPair pair(host);
    pair.memory->write_first(call, call.size());
    switch (kind) {
      case 0:
        pair.memory->to_server_tail() = 1;
        break;
      case 1:
        pair.memory->to_server_tail() = 1 << 20;
        break;
      case 2:
        pair.memory->to_server_tail() = ~std::uint64_t{63};
        break;
      case 3:
        pair.memory->write_first(call, 0);
        break;
      case 4:
        pair.memory->write_first(call, wire::kSharedFrameSizeMax + 1);
        break;
      case 5:
        pair.memory->write_first(call, 121);
        break;
      case 6:
        pair.memory->write_first(call, call.size(), 2);
        break;
      case 7:
        pair.memory->write_to_slot(call, 0);
        break;
      default:
        pair.memory->write_to_slot(call, 249);
    }
    expect_error(*pair.connection, IoError::kBroken);
  }
  Host host;
  RawPair pair(host);
  pair.memory->to_client_head() = 64;
  expected<void, IoError> sent;
  for (int i = 0; i < 2000 && sent; ++i)
    sent = pair.connection->send(call, rt::now());
  ASSERT_FALSE(sent);
  EXPECT_EQ(sent.error(), IoError::kFull) << "64 is a head like another, but it has to move";
  pair.memory->to_client_head() = 63;
  sent = pair.connection->send(call, rt::now());
  ASSERT_FALSE(sent);
  EXPECT_EQ(sent.error(), IoError::kBroken);
  pair.memory->to_client_head() = 64;
  pair.memory->to_client_taken() = 1 << 20;
  sent = pair.connection->send(call, rt::now());
  ASSERT_FALSE(sent);
  EXPECT_EQ(sent.error(), IoError::kBroken) << "more slots were taken than written";
}

// hp-16.2-3: whatever a peer writes to the memory, the other end survives and stays within its
// bounds, which the sanitizers check.
TEST(SharedMemoryRings, SurviveAPeerThatOverwritesThem) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    Host host;
    RawPair pair(host);
    std::atomic<bool> is_over{false};
    std::thread scribbler([&] {
      std::mt19937_64 random(seed);
      while (!is_over) {
        const std::uint64_t noise = random();
        pair.memory->word(noise % (pair.memory->size() / 8) * 8) = random() % 40'000;
        if (noise % 16 == 0) pair.memory->to_server_tail() = random() % 4096 * 64;
        if (noise % 64 == 1) pair.memory->to_client_head() = random() % 4096 * 64;
        if (noise % 64 == 2) pair.memory->to_client_taken() = static_cast<std::uint32_t>(noise);
        pair.memory->to_client_sleeping() = 1;
      }
    });
    const std::array<Bytes, 2> replies{frame_of(100), frame_of(1000)};
    for (std::size_t i = 0; i < 3000; ++i) {
      const auto frame = pair.connection->receive();
      if (frame) {
        EXPECT_LE(frame->size(), wire::kSharedFrameSizeMax);
      } else if (frame.error() == IoError::kBroken) {
        break;
      }
      const auto sent = pair.connection->send(replies[i % 2], MonotonicTime::min());
      if (!sent && sent.error() == IoError::kBroken) break;
    }
    is_over = true;
    scribbler.join();
  }
}

TEST(SharedMemoryRings, WaitForCapacityUntilTheDeadline) {
  Host host;
  Pair pair(host);
  const Bytes frame = frame_of(10'000);
  expected<void, IoError> sent;
  while (sent)
    sent = pair.connection->send(frame, MonotonicTime::min());
  EXPECT_EQ(sent.error(), IoError::kFull);
  const MonotonicTime until = rt::now() + 5ms;
  sent = pair.connection->send(frame, until);
  ASSERT_FALSE(sent);
  EXPECT_EQ(sent.error(), IoError::kFull);
  EXPECT_GE(rt::now(), until);
  std::thread reader([&] { expect_frame(*pair.client, frame); });
  EXPECT_TRUE(pair.connection->send(frame, soon()));
  reader.join();
}

// ---- waking -------------------------------------------------------------------------------------

// hp-16.3-1
TEST(SharedMemoryRings, RingOnceForASleeper) {
  Host host;
  RawPair pair(host);
  const Bytes frame = frame_of(48);
  ASSERT_TRUE(pair.connection->send(frame, rt::now()));
  EXPECT_EQ(pair.take_bells(), 0) << "nobody sleeps";
  pair.memory->to_client_sleeping() = 1;
  ASSERT_TRUE(pair.connection->send(frame, rt::now()));
  ASSERT_TRUE(pair.connection->send(frame, rt::now()));
  EXPECT_EQ(pair.take_bells(), 1);
  EXPECT_EQ(pair.memory->to_client_sleeping(), 0u);
}

// hp-16.3-1: checked against the specification alone.
TEST(SharedMemoryRings, WakeAServerByTheEventOfItsAnswer) {
  Host host;
  RawPair pair(host);
  auto opened = WaitSet::open(1);
  ASSERT_TRUE(opened);
  WaitSet& wait_set = **opened;
  ASSERT_TRUE(wait_set.add(pair.connection->event(), kEvent, Trigger::kEdge));
  ASSERT_TRUE(pair.connection->announce_sleep());
  EXPECT_EQ(pair.memory->to_server_sleeping(), 3u);
  const std::uint64_t one = 1;
  ASSERT_EQ(write(pair.event.number(), &one, sizeof one), 8);
  std::array<SourceTag, 4> tags{};
  EXPECT_EQ(wait_set.wait(soon(), tags), 1);
}

// hp-16.3-1
TEST(SharedMemoryRings, WakeASleeperOnTheWordWithoutABell) {
  Host host;
  RawPair pair(host);
  std::atomic_ref<std::uint64_t> sleeping = pair.memory->to_client_sleeping();
  std::atomic<bool> is_awake{false};
  sleeping = 2;
  std::thread sleeper([&] {
    while (sleeping == 2) {
      const timespec patience{.tv_sec = 20, .tv_nsec = 0};
      if (syscall(SYS_futex, pair.memory->at(256 + 128), FUTEX_WAIT, 2, &patience, nullptr, 0) !=
              0 &&
          errno == ETIMEDOUT) {
        return;
      }
    }
    is_awake = true;
  });
  ASSERT_TRUE(pair.connection->send(frame_of(48), rt::now()));
  sleeper.join();
  EXPECT_TRUE(is_awake);
  EXPECT_EQ(pair.take_bells(), 0);
}

// hp-16.3-1
TEST(SharedMemoryRings, WakeAServerThatSleeps) {
  Host host;
  Pair pair(host);
  auto opened = WaitSet::open(1);
  ASSERT_TRUE(opened);
  WaitSet& wait_set = **opened;
  ASSERT_TRUE(wait_set.add(pair.connection->event(), kEvent, Trigger::kEdge));
  std::array<SourceTag, 4> tags{};
  ASSERT_TRUE(pair.connection->announce_sleep());
  EXPECT_EQ(wait_set.wait(kAlready, tags), 0);
  ASSERT_TRUE(pair.client->send(frame_of(1)));
  ASSERT_EQ(wait_set.wait(soon(), tags), 1);
  EXPECT_EQ(tags[0], kEvent);
  pair.connection->end_sleep();
  EXPECT_EQ(wait_set.wait(kAlready, tags), 0) << "one signal, one wake-up";
  ASSERT_TRUE(pair.client->send(frame_of(1)));
  EXPECT_EQ(wait_set.wait(kAlready, tags), 0) << "nobody sleeps";
  EXPECT_FALSE(pair.connection->announce_sleep()) << "the frame is still there";
  pair.connection->end_sleep();
  expect_frame(*pair.connection, frame_of(1));
}

// hp-16.3-1
TEST(SharedMemoryRings, WakeAClientThatPolls) {
  Host host;
  Pair pair(host);
  const auto is_readable = [&] {
    return wait_readable(pair.client->descriptor(), MonotonicTime{});
  };
  ASSERT_TRUE(pair.client->announce_sleep());
  EXPECT_FALSE(is_readable());
  ASSERT_TRUE(pair.connection->send(frame_of(1), rt::now()));
  EXPECT_TRUE(is_readable());
  EXPECT_FALSE(pair.client->announce_sleep()) << "the frame is still there";
  pair.client->end_sleep();
  EXPECT_FALSE(is_readable()) << "the bell was taken";
  EXPECT_TRUE(pair.client->receive());
}

TEST(SharedMemoryRings, EndForAClientWhoseBellCameTooLate) {
  Host host;
  Pair pair(host);
  ASSERT_TRUE(pair.client->announce_sleep());
  ASSERT_TRUE(pair.connection->send(frame_of(1), rt::now()));
  EXPECT_TRUE(pair.client->receive());
  pair.connection.reset();
  pair.client->check_peer();
  pair.client->check_peer();
  const auto end = pair.client->receive();
  ASSERT_FALSE(end);
  EXPECT_EQ(end.error(), IoError::kClosed);
}

TEST(SharedMemoryRings, EndAWaitWhenAFrameArrives) {
  Host host;
  Pair pair(host);
  std::thread server([&] {
    for (std::uint32_t i = 0; i < 200; ++i) {
      // The ring comes before, while and after the client goes to sleep.
      rt::sleep_until(rt::now() + std::chrono::microseconds{i});
      ASSERT_TRUE(pair.connection->send(frame_of(48, 0, i), rt::now()));
    }
  });
  for (std::uint32_t i = 0; i < 200;) {
    const auto frame = receive(*pair.client);
    if (frame) {
      EXPECT_EQ(*frame, frame_of(48, 0, i));
      ++i;
    } else {
      const MonotonicTime until = soon();
      pair.client->wait(until);
      ASSERT_LT(rt::now(), until) << "nobody woke it";
    }
  }
  server.join();
}

TEST(SharedMemoryRings, EndAWaitAtItsDeadline) {
  Host host;
  Pair pair(host);
  const MonotonicTime until = rt::now() + 5ms;
  pair.client->wait(until);
  EXPECT_GE(rt::now(), until);
  expect_error(*pair.client, IoError::kNothing);
}

// hp-16.3-2
TEST(SharedMemoryRings, AcceptUnexpectedBells) {
  Host host;
  RawPair pair(host);
  for (int i = 0; i < 10; ++i)
    write_all(pair.socket, Bytes(1, std::byte{0x55}));
  for (int i = 0; i < 10; ++i) {
    EXPECT_TRUE(wait_readable(pair.connection->descriptor(), rt::now()));
    pair.connection->on_ready();
    expect_error(*pair.connection, IoError::kNothing);
  }
  EXPECT_FALSE(wait_readable(pair.connection->descriptor(), rt::now()));
}

// hp-16.3-3
TEST(SharedMemoryRings, NeverWaitForAPeerThatReadsNoBell) {
  Host host;
  RawPair pair(host);
  const Bytes frame = frame_of(48);
  for (int i = 0; i < 20'000; ++i) {
    pair.memory->to_client_sleeping() = 1;
    ASSERT_TRUE(pair.connection->send(frame, rt::now()));
    pair.memory->to_client_taken() = static_cast<std::uint32_t>(i + 1);
  }
  const int bell_count = pair.take_bells();
  EXPECT_GT(bell_count, 0);
  EXPECT_LT(bell_count, 20'000) << "the socket was full, or this shows nothing";
}

}  // namespace
}  // namespace rtpm::transport
