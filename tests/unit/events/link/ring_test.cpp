#include "broadcast/ring.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <cstring>
#include <memory>
#include <string>
#include <thread>
#include <vector>

namespace rtpm::events {
namespace {

constexpr std::uint64_t kId = 77;
constexpr std::uint64_t kOwner = 5;

/// A ring and its writer, in its own memory.
struct Ring {
  struct alignas(4096) Page {
    std::byte bytes[4096];
  };
  std::vector<Page> pages{ring_memory_size(kRingSizeMin) / sizeof(Page)};
  MutableBytes memory{pages.data()->bytes, ring_memory_size(kRingSizeMin)};
  RingWriter writer{memory, kId};

  void write(std::initializer_list<std::uint32_t> slots, std::string_view text) {
    SlotSet set;
    for (const std::uint32_t slot : slots)
      set.add(slot);
    EXPECT_TRUE(writer.write(set, std::as_bytes(std::span(text)), 1));
  }
  RingReader reader(std::uint32_t slot) {
    writer.begin_slot(slot, kOwner);
    return {memory, slot, kOwner, writer.position()};
  }
};

std::string text_of(const RingReader& reader) {
  return {reinterpret_cast<const char*>(reader.events().data()), reader.events().size()};
}

/// Reads until the ring is empty; returns the events, separated by blanks.
std::string remaining_of(RingReader& reader) {
  std::string text;
  for (RingRead read = reader.read(); read != RingRead::kNothing; read = reader.read()) {
    EXPECT_EQ(read, RingRead::kEvents);
    if (read != RingRead::kEvents) break;
    reader.count_read(1);
    text += (text.empty() ? "" : " ") + text_of(reader);
  }
  return text;
}

TEST(Ring, EachReaderGetsLaterRecordsOfItsSlot) {
  Ring ring;
  ring.write({0, 63, 1023}, "before");
  RingReader first = ring.reader(0);
  RingReader second = ring.reader(63);
  RingReader third = ring.reader(1023);
  ring.write({0, 63}, "a");
  ring.write({1023}, "b");
  ring.write({0, 63, 1023}, "c");
  EXPECT_EQ(remaining_of(first), "a c");
  EXPECT_EQ(remaining_of(second), "a c");
  EXPECT_EQ(remaining_of(third), "b c");
  EXPECT_EQ(third.written_count(), 2U);
  EXPECT_FALSE(third.has_more());
}

TEST(Ring, WrapsWithRecordsOfAnySize) {
  Ring ring;
  RingReader reader = ring.reader(9);
  for (std::size_t i = 0; i < 5000; ++i) {
    const std::string text(1 + i * 37 % 9000, static_cast<char>('a' + i % 26));
    ring.write({9}, text);
    ASSERT_EQ(remaining_of(reader), text);
  }
  EXPECT_EQ(reader.missed_count(), 0U);
}

TEST(Ring, EventsAreAlignedAndTooLargeOnesRefused) {
  Ring ring;
  RingReader reader = ring.reader(200);
  ring.write({200}, "a");
  ASSERT_EQ(reader.read(), RingRead::kEvents);
  EXPECT_EQ(reinterpret_cast<std::uintptr_t>(reader.events().data()) % 16, 0U);
  const std::vector<std::byte> large(kRingSizeMin / 4);
  SlotSet slots;
  slots.add(200);
  EXPECT_FALSE(ring.writer.write(slots, large, 1));
  EXPECT_FALSE(reader.has_more());
}

TEST(Ring, OverrunReaderCountsItsMisses) {
  Ring ring;
  RingReader reader = ring.reader(1);
  ring.write({1}, "first");
  EXPECT_EQ(remaining_of(reader), "first");
  const std::string text(1000, 'x');
  for (int i = 0; i < 500; ++i) {
    ring.write({1}, text);
    ring.write({2}, text);
  }
  EXPECT_EQ(reader.read(), RingRead::kOverrun);
  ring.write({1}, "after");
  EXPECT_EQ(remaining_of(reader), "after");
  EXPECT_EQ(reader.missed_count(), 500U);
  EXPECT_EQ(reader.written_count(), 502U);
}

TEST(Ring, ReaderOfAReusedSlotReadsNothing) {
  Ring ring;
  RingReader former = ring.reader(4);
  ring.writer.end_slot(4);
  ring.writer.begin_slot(4, kOwner + 1);
  ring.write({4}, "secret");
  EXPECT_EQ(former.read(), RingRead::kGone);
}

TEST(Ring, RejectsForeignOrShortMemory) {
  Ring ring;
  EXPECT_TRUE(RingReader::is_ring(ring.memory, kId));
  EXPECT_FALSE(RingReader::is_ring(ring.memory, kId + 1));
  EXPECT_FALSE(RingReader::is_ring(ConstBytes(ring.memory).first(kRingDataOffset), kId));
}

TEST(Ring, StopsAtAMalformedRecord) {
  Ring ring;
  RingReader reader = ring.reader(1);
  ring.write({1}, "a");
  std::memset(ring.memory.data() + kRingDataOffset + 8, 0xff, 8);
  EXPECT_EQ(reader.read(), RingRead::kBroken);
}

// Whatever the threads do, a reader sees a record whole or not at all, in order, and every record
// is either read or counted as missed.
TEST(Ring, OvertakenReadersNeverSeeATornRecord) {
  Ring ring;
  constexpr std::uint64_t kCount = 100'000;
  std::vector<RingReader> readers;
  for (std::uint32_t slot = 0; slot < 2; ++slot)
    readers.push_back(ring.reader(slot));
  std::atomic<bool> is_done{false};
  const auto read_all = [&](RingReader& reader) {
    std::uint64_t last = 0;
    std::uint64_t wrong = 0;
    while (true) {
      const bool is_last_read = is_done;
      const RingRead read = reader.read();
      if (read == RingRead::kNothing && is_last_read) break;
      if (read != RingRead::kEvents) continue;
      reader.count_read(1);
      std::vector<std::uint64_t> words(reader.events().size() / 8);
      std::memcpy(words.data(), reader.events().data(), reader.events().size());
      for (const std::uint64_t word : words)
        wrong += word == words[0] ? 0U : 1U;
      wrong += words[0] > last ? 0U : 1U;
      last = words[0];
    }
    EXPECT_EQ(wrong, 0U);
    EXPECT_EQ(reader.read_count() + reader.missed_count(), reader.written_count());
  };
  std::vector<std::thread> threads;
  for (RingReader& reader : readers)
    threads.emplace_back([&] { read_all(reader); });
  SlotSet both;
  both.add(0);
  both.add(1);
  for (std::uint64_t i = 1; i <= kCount; ++i) {
    const std::vector<std::uint64_t> words(1 + i % 60, i);
    ASSERT_TRUE(ring.writer.write(both, std::as_bytes(std::span(words)), 1));
  }
  is_done = true;
  for (std::thread& thread : threads)
    thread.join();
}

}  // namespace
}  // namespace rtpm::events
