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
    alignas(64) std::array<std::byte, kRecordSlotsSize> slots{};
    std::array<std::byte, kRingSize> data{};

    [[nodiscard]] RecordRingMemory parts() { return {control, slots, data}; }
  };

  Outcome write(const Bytes& record) { return writer_.write(record); }
  expected<Bytes, RecordError> read() {
    const auto size = reader_.read(buffer_);
    if (!size) return unexpected{size.error()};
    return Bytes(buffer_.begin(), buffer_.begin() + static_cast<std::ptrdiff_t>(*size));
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
  RecordWriter writer_{memory_->parts()};
  RecordReader reader_{memory_->parts()};
  std::array<std::byte, kRecordSizeMax> buffer_{};
};

TEST_F(RecordRingTest, ReturnsRecordsInTheirOrder) {
  expect_error(RecordError::kEmpty);
  std::vector<Bytes> records;
  // Some of these records are short and find a slot, some are too long, and the last find no slot.
  for (const std::size_t size : {1u,   7u,   8u,   9u,   55u,  56u,  57u, 63u,  64u, 112u,
                                 120u, 121u, 247u, 248u, 249u, 256u, 1u,  900u, 1u,  248u}) {
    records.push_back(record_of(size, static_cast<std::uint32_t>(size)));
    ASSERT_EQ(write(records.back()), Outcome::kWritten);
  }
  for (const Bytes& record : records)
    expect_record(record);
  expect_error(RecordError::kEmpty);
}

TEST_F(RecordRingTest, WritesNothingWhenFull) {
  const Bytes record = record_of(120, 1);  // The record takes a slot, or two lines.
  std::size_t count = 0;
  while (write(record) == Outcome::kWritten)
    ++count;
  EXPECT_EQ(count, kRecordSlotCount + kRingSize / 128) << "every slot and byte is used";
  EXPECT_EQ(write(record), Outcome::kFull);
  for (std::uint32_t i = 0; i < kRecordSlotCount; ++i)
    expect_record(record);
  EXPECT_EQ(write(record), Outcome::kFull) << "the records were in slots; the ring is full";
  expect_record(record);
  EXPECT_EQ(write(record), Outcome::kWritten) << "reading frees capacity";
  EXPECT_EQ(write(record), Outcome::kFull);
}

// hp-16.4-2: records that may wait leave capacity for records that may not.
TEST_F(RecordRingTest, ReportsWhetherHalfOfItStaysFree) {
  const Bytes record = record_of(500, 1);  // The record takes 512 bytes of the ring.
  std::size_t count = 0;
  while (writer_.has_spare_capacity(record.size())) {
    ASSERT_EQ(write(record), Outcome::kWritten);
    ++count;
  }
  EXPECT_EQ(count, std::max<std::size_t>(1, kRingSize / 2 / 512));
  EXPECT_EQ(write(record), Outcome::kWritten) << "there is some";
  for (std::size_t i = 0; i <= count; ++i)
    expect_record(record);
  EXPECT_TRUE(writer_.has_spare_capacity(record.size()));
  memory_->control.head = 3;
  ASSERT_EQ(write(record), Outcome::kWritten);
  EXPECT_TRUE(writer_.has_spare_capacity(kRingSize)) << "write() reports an invalid head";
}

// hp-16.2-1: the ring takes long records, and short ones while many are unread.
TEST_F(RecordRingTest, PutsShortRecordsIntoSlots) {
  for (std::uint32_t i = 0; i < 100; ++i) {
    ASSERT_EQ(write(record_of(kShortRecordMax, i)), Outcome::kWritten);
    expect_record(record_of(kShortRecordMax, i));
  }
  EXPECT_EQ(memory_->control.tail, 0u);
  ASSERT_EQ(write(record_of(kShortRecordMax + 1, 1)), Outcome::kWritten);
  EXPECT_EQ(memory_->control.tail, 320u);
  for (std::uint32_t i = 1; i < kRecordSlotCount; ++i)
    ASSERT_EQ(write(record_of(1, i)), Outcome::kWritten);
  EXPECT_EQ(memory_->control.tail, 320u) << "sixteen are not read";
  ASSERT_EQ(write(record_of(1, 1)), Outcome::kWritten);
  EXPECT_EQ(memory_->control.tail, 384u) << "the seventeenth goes to the ring";
}

// This holds for any interleaving of reader and writer, and any content of slots and ring.
TEST_F(RecordRingTest, KeepsTheOrderOfShortAndLongRecords) {
  std::mt19937_64 random(7);
  std::uint32_t written = 0;
  for (std::uint32_t taken = 0; taken < 20'000;) {
    const auto size_of = [](std::uint32_t i) { return i % 3 == 0 ? 300 + i % 500 : 1 + i % 200; };
    for (auto burst = random() % 24; burst > 0; --burst) {
      if (write(record_of(size_of(written), written)) != Outcome::kWritten) break;
      ++written;
    }
    for (auto burst = random() % 24; burst > 0 && taken < written; --burst, ++taken)
      expect_record(record_of(size_of(taken), taken));
    if (taken == written) expect_error(RecordError::kEmpty);
  }
}

// hp-16.3-1
TEST_F(RecordRingTest, WakesASleeperOnceAndWhereItSleeps) {
  ASSERT_TRUE(reader_.announce_sleep(RecordSleep::kAtBell));
  EXPECT_EQ(write(record_of(10, 1)), Outcome::kWrittenForBell);
  EXPECT_EQ(write(record_of(10, 2)), Outcome::kWritten);
  reader_.end_sleep();
  expect_record(record_of(10, 1));
  expect_record(record_of(10, 2));
  EXPECT_EQ(write(record_of(10, 3)), Outcome::kWritten) << "it is awake";
  expect_record(record_of(10, 3));
  ASSERT_TRUE(reader_.announce_sleep(RecordSleep::kAtWord));
  EXPECT_EQ(reader_.sleeping(), 2u);
  EXPECT_EQ(write(record_of(10, 4)), Outcome::kWrittenForWord);
  EXPECT_EQ(write(record_of(10, 5)), Outcome::kWritten);
  EXPECT_EQ(&reader_.sleeping(), &writer_.sleeping());
}

TEST_F(RecordRingTest, RefusesToSleepWhileARecordIsUnread) {
  EXPECT_FALSE(reader_.has_record());
  ASSERT_EQ(write(record_of(10, 1)), Outcome::kWritten);
  EXPECT_TRUE(reader_.has_record());
  EXPECT_FALSE(reader_.announce_sleep(RecordSleep::kAtBell));
  reader_.end_sleep();
  ASSERT_EQ(write(record_of(10, 2)), Outcome::kWritten);
  expect_record(record_of(10, 1));
  // The reader knows the second record from its first read.
  EXPECT_TRUE(reader_.has_record());
  EXPECT_FALSE(reader_.announce_sleep(RecordSleep::kAtBell));
}

TEST_F(RecordRingTest, PassesRecordsBetweenThreadsThatSleep) {
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
      // Only the writer's wake-up ends this loop.
      while (wake_count == before)
        std::this_thread::yield();
    }
    reader_.end_sleep();
  }
  producer.join();
  EXPECT_EQ(wrong_count, 0u);
}

// hp-16.2-2
TEST_F(RecordRingTest, RefusesToWriteBehindAnImpossibleReader) {
  const Bytes record = record_of(504, 1);  // The record takes eight lines.
  for (std::size_t i = 0; i < kRingSize / 512; ++i)
    ASSERT_EQ(write(record), Outcome::kWritten);
  for (const std::uint64_t head :
       {std::uint64_t{1}, std::uint64_t{kRingSize + 64}, ~std::uint64_t{63}}) {
    memory_->control.head = head;
    EXPECT_EQ(write(record), Outcome::kBroken) << head;
  }
  memory_->control.head = kRingSize;
  EXPECT_EQ(write(record), Outcome::kWritten);
}

// hp-16.2-2
TEST_F(RecordRingTest, RefusesToWriteAfterAnImpossibleCountOfTakenRecords) {
  const Bytes record = record_of(56, 1);
  for (std::uint32_t i = 0; i < kRecordSlotCount; ++i)
    ASSERT_EQ(write(record), Outcome::kWritten);
  for (const std::uint32_t taken : {kRecordSlotCount + 1, ~std::uint32_t{0}, 1U << 31}) {
    memory_->control.taken = taken;
    EXPECT_EQ(write(record), Outcome::kBroken) << taken;
  }
  memory_->control.taken = kRecordSlotCount;
  EXPECT_EQ(write(record), Outcome::kWritten);
}

// hp-16.2-2, hp-16.2-3, hp-16.2-4
TEST_F(RecordRingTest, RefusesToReadImpossibleRecords) {
  struct Case {
    std::uint64_t tail;
    RecordWord in_ring;
    RecordWord in_slot;
    RecordError error;
  };
  constexpr RecordWord kNone{0, 0};
  std::vector<Case> cases;
  for (const std::uint64_t tail :
       {std::uint64_t{1}, std::uint64_t{63}, std::uint64_t{65}, std::uint64_t{kRingSize + 64},
        ~std::uint64_t{0}, ~std::uint64_t{63}, std::uint64_t{1} << 63})
    cases.push_back({tail, kNone, kNone, RecordError::kBroken});
  for (const std::uint32_t size :
       {0u, 121u, 1000u, 1001u, static_cast<std::uint32_t>(kRingSize), ~0u, ~0u - 7, 1u << 31})
    cases.push_back({128, {size, 1}, kNone, RecordError::kBroken});
  for (const std::uint32_t size : {0u, 249u, 256u, ~0u})
    cases.push_back({0, kNone, {size, 1}, RecordError::kBroken});
  for (const std::uint32_t number : {0u, 2u, ~0u}) {
    cases.push_back({128, {100, number}, kNone, RecordError::kBroken});
    // A slot with another number holds an earlier record, or nothing.
    cases.push_back({0, kNone, {100, number}, RecordError::kEmpty});
  }
  for (const Case& each : cases) {
    Memory memory;
    memory.control.tail = each.tail;
    const std::uint64_t in_ring = each.in_ring.value();
    const std::uint64_t in_slot = each.in_slot.value();
    std::memcpy(memory.data.data(), &in_ring, sizeof in_ring);
    std::memcpy(memory.slots.data() + kRecordSlotSize, &in_slot, sizeof in_slot);
    RecordReader reader(memory.parts());
    const auto given = reader.read(buffer_);
    ASSERT_FALSE(given) << each.tail;
    EXPECT_EQ(given.error(), each.error) << each.tail << " " << in_ring << " " << in_slot;
  }
}

}  // namespace
}  // namespace rtpm
