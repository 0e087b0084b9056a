#include "rtpm/base/record_ring.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <memory>
#include <random>
#include <thread>
#include <vector>

namespace rtpm {
namespace {

using Bytes = std::vector<std::byte>;
using Outcome = RecordWriter::Outcome;

constexpr std::size_t kRingSize = 4096;
constexpr std::size_t kRecordSizeMax = 1000;

Bytes record_of(std::size_t size, std::uint32_t salt) {
  Bytes record(size);
  for (std::size_t i = 0; i < size; ++i)
    record[i] = static_cast<std::byte>(salt + i * 7);
  return record;
}

/// The shared memory of a ring and both its ends.
class RecordRingTest : public testing::Test {
 protected:
  struct alignas(64) Memory {
    RecordRingControl control;
    std::array<std::byte, kRingSize> data{};
  };

  Outcome write(const Bytes& record) { return writer_.write(record); }
  expected<Bytes, RecordError> read() {
    const auto size = reader_.read(room_);
    if (!size) return unexpected{size.error()};
    return Bytes(room_.begin(), room_.begin() + static_cast<std::ptrdiff_t>(*size));
  }
  void expect_record(const Bytes& record) {
    const auto given = read();
    ASSERT_TRUE(given);
    EXPECT_EQ(*given, record);
  }
  void expect_error(RecordError error) {
    const auto given = read();
    ASSERT_FALSE(given);
    EXPECT_EQ(given.error(), error);
  }

  std::unique_ptr<Memory> memory_ = std::make_unique<Memory>();
  RecordWriter writer_{memory_->control, memory_->data};
  RecordReader reader_{memory_->control, memory_->data};
  std::array<std::byte, kRecordSizeMax> room_{};
};

TEST_F(RecordRingTest, GivesRecordsInTheOrderTheyCame) {
  expect_error(RecordError::kEmpty);
  std::vector<Bytes> records;
  for (const std::size_t size : {1u, 7u, 8u, 9u, 55u, 56u, 57u, 63u, 64u, 112u, 120u, 121u}) {
    records.push_back(record_of(size, static_cast<std::uint32_t>(size)));
    ASSERT_EQ(write(records.back()), Outcome::kWritten);
  }
  for (const Bytes& record : records)
    expect_record(record);
  expect_error(RecordError::kEmpty);
}

TEST_F(RecordRingTest, GoesRoundWithRecordsOfAllSizes) {
  std::mt19937_64 random(1);
  for (std::uint32_t i = 0; i < 2000; ++i) {
    const Bytes record = record_of(1 + random() % kRecordSizeMax, i);
    ASSERT_EQ(write(record), Outcome::kWritten);
    expect_record(record);
  }
}

TEST_F(RecordRingTest, WhenFullItWritesNothing) {
  const Bytes record = record_of(120, 1);  // Two lines.
  std::size_t count = 0;
  while (write(record) == Outcome::kWritten)
    ++count;
  EXPECT_EQ(count, kRingSize / 128) << "every byte of the ring is used";
  EXPECT_EQ(write(record), Outcome::kFull);
  expect_record(record);
  EXPECT_EQ(write(record), Outcome::kWritten) << "what was read makes room";
  EXPECT_EQ(write(record), Outcome::kFull);
}

// hp-16.3-1
TEST_F(RecordRingTest, WakesASleeperOnce) {
  ASSERT_TRUE(reader_.announce_sleep(RecordSleep::kAtBell));
  EXPECT_EQ(write(record_of(10, 1)), Outcome::kWrittenForBell);
  EXPECT_EQ(write(record_of(10, 2)), Outcome::kWritten);
  reader_.end_sleep();
  expect_record(record_of(10, 1));
  expect_record(record_of(10, 2));
  EXPECT_EQ(write(record_of(10, 3)), Outcome::kWritten) << "it is awake";
}

// hp-16.3-1
TEST_F(RecordRingTest, TellsWhereTheReaderSleeps) {
  ASSERT_TRUE(reader_.announce_sleep(RecordSleep::kAtWord));
  EXPECT_EQ(reader_.sleeping(), 2u);
  EXPECT_EQ(write(record_of(10, 1)), Outcome::kWrittenForWord);
  EXPECT_EQ(write(record_of(10, 2)), Outcome::kWritten);
  EXPECT_EQ(&reader_.sleeping(), &writer_.sleeping());
}

TEST_F(RecordRingTest, NobodySleepsOnARecord) {
  EXPECT_FALSE(reader_.has_record());
  ASSERT_EQ(write(record_of(10, 1)), Outcome::kWritten);
  EXPECT_TRUE(reader_.has_record());
  EXPECT_FALSE(reader_.announce_sleep(RecordSleep::kAtBell));
  reader_.end_sleep();
  ASSERT_EQ(write(record_of(10, 2)), Outcome::kWritten);
  expect_record(record_of(10, 1));
  // The second is known from the first look.
  EXPECT_TRUE(reader_.has_record());
  EXPECT_FALSE(reader_.announce_sleep(RecordSleep::kAtBell));
}

TEST_F(RecordRingTest, CarriesRecordsFromThreadToThreadWithSleep) {
  constexpr std::uint32_t kCount = 20'000;
  std::atomic<int> wake_count{0};
  std::thread producer([&] {
    std::mt19937_64 random(2);
    for (std::uint32_t i = 0; i < kCount;) {
      const Bytes record = record_of(1 + i % kRecordSizeMax, i);
      switch (write(record)) {
        case Outcome::kWrittenForBell:
          ++wake_count;
          [[fallthrough]];
        case Outcome::kWritten:
          ++i;
          break;
        default:
          std::this_thread::yield();
      }
    }
  });
  std::uint32_t wrong_count = 0;
  for (std::uint32_t i = 0; i < kCount;) {
    const auto record = read();
    if (record) {
      if (*record != record_of(1 + i % kRecordSizeMax, i)) ++wrong_count;
      ++i;
      continue;
    }
    const int before = wake_count;
    if (reader_.announce_sleep(RecordSleep::kAtBell)) {
      // Whoever sleeps is woken: nothing but that ends this.
      while (wake_count == before)
        std::this_thread::yield();
    }
    reader_.end_sleep();
  }
  producer.join();
  EXPECT_EQ(wrong_count, 0u);
}

// hp-16.2-2
TEST_F(RecordRingTest, TakesNoImpossibleTail) {
  for (const std::uint64_t tail :
       {std::uint64_t{1}, std::uint64_t{63}, std::uint64_t{65}, std::uint64_t{kRingSize + 64},
        ~std::uint64_t{0}, ~std::uint64_t{63}, std::uint64_t{1} << 63}) {
    memory_->control.tail = tail;
    RecordReader reader(memory_->control, memory_->data);
    const auto given = reader.read(room_);
    ASSERT_FALSE(given) << tail;
    EXPECT_EQ(given.error(), RecordError::kBroken) << tail;
  }
}

// hp-16.2-2
TEST_F(RecordRingTest, TakesNoImpossibleHead) {
  const Bytes record = record_of(56, 1);  // One line.
  for (std::size_t i = 0; i < kRingSize / 64; ++i)
    ASSERT_EQ(write(record), Outcome::kWritten);
  for (const std::uint64_t head :
       {std::uint64_t{1}, std::uint64_t{kRingSize + 64}, ~std::uint64_t{63}}) {
    memory_->control.head = head;
    EXPECT_EQ(write(record), Outcome::kBroken) << head;
  }
  memory_->control.head = kRingSize;
  EXPECT_EQ(write(record), Outcome::kWritten);
}

// hp-16.2-3
TEST_F(RecordRingTest, TakesNoImpossibleSize) {
  for (const std::uint64_t size :
       {std::uint64_t{0}, std::uint64_t{121}, std::uint64_t{kRecordSizeMax},
        std::uint64_t{kRecordSizeMax + 1}, std::uint64_t{kRingSize}, ~std::uint64_t{0},
        ~std::uint64_t{0} - 7, std::uint64_t{1} << 32}) {
    Memory memory;
    memory.control.tail = 128;
    std::memcpy(memory.data.data(), &size, sizeof size);
    RecordReader reader(memory.control, memory.data);
    const auto given = reader.read(room_);
    ASSERT_FALSE(given) << size;
    EXPECT_EQ(given.error(), RecordError::kBroken) << size;
  }
}

// Somebody scribbles over all that is shared while both ends work. Whatever they are given, they
// stay within the ring, which the sanitizers watch, and come to an end.
TEST_F(RecordRingTest, SurvivesAnybodyWhoScribblesOverIt) {
  std::atomic<bool> is_over{false};
  std::thread scribbler([&] {
    std::mt19937_64 random(3);
    auto* words = reinterpret_cast<std::uint64_t*>(memory_->data.data());
    while (!is_over) {
      const std::uint64_t noise = random();
      const std::uint64_t small = noise % (2 * kRecordSizeMax);
      std::atomic_ref<std::uint64_t>(words[random() % (kRingSize / 8)]).store(small);
      if (noise % 64 == 0) memory_->control.tail = random() % 8 == 0 ? random() : small * 64;
      if (noise % 64 == 1) memory_->control.head = random() % 8 == 0 ? random() : small * 64;
      memory_->control.sleeping = static_cast<std::uint32_t>(noise);
    }
  });
  int broken_count = 0;
  for (int round = 0; round < 2000; ++round) {
    RecordWriter writer(memory_->control, memory_->data);
    RecordReader reader(memory_->control, memory_->data);
    for (std::uint32_t i = 0; i < 200; ++i) {
      const Outcome outcome = writer.write(record_of(1 + i % kRecordSizeMax, i));
      const auto size = reader.read(room_);
      if (size) {
        ASSERT_LE(*size, room_.size());
      } else if (size.error() == RecordError::kBroken || outcome == Outcome::kBroken) {
        ++broken_count;
        break;
      }
    }
  }
  is_over = true;
  scribbler.join();
  EXPECT_GT(broken_count, 0) << "the scribbler did not come to it";
}

}  // namespace
}  // namespace rtpm
