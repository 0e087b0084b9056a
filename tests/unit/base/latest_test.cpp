#include "rtpm/base/latest.hpp"

#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <cstdint>
#include <functional>
#include <thread>
#include <vector>

namespace rtpm {
namespace {

/// A state whose words must all be equal, so that a torn copy shows.
struct Sample {
  std::array<std::uint64_t, 13> words{};
  std::uint8_t tail = 0;
};

Sample sample_of(std::uint64_t number) {
  Sample sample;
  sample.words.fill(number);
  sample.tail = static_cast<std::uint8_t>(number);
  return sample;
}

bool is_whole(const Sample& sample) {
  for (const std::uint64_t word : sample.words) {
    if (word != sample.words[0]) return false;
  }
  return sample.tail == static_cast<std::uint8_t>(sample.words[0]);
}

TEST(Latest, IsEmptyBeforeTheFirstWrite) {
  const Latest<Sample> latest;
  EXPECT_FALSE(latest.read());
  EXPECT_EQ(latest.count(), 0u);
}

TEST(Latest, GivesTheNewestValueToEachRead) {
  Latest<Sample> latest;
  latest.write(sample_of(1));
  latest.write(sample_of(2));
  EXPECT_EQ(latest.count(), 2u);
  for (int i = 0; i < 3; ++i) {
    const auto sample = latest.read();
    ASSERT_TRUE(sample);
    EXPECT_EQ(sample->words[0], 2u);
    EXPECT_EQ(sample->tail, 2u);
  }
}

TEST(Latest, HoldsValuesSmallerThanAWord) {
  Latest<std::uint8_t> latest;
  latest.write(200);
  EXPECT_EQ(latest.read(), std::uint8_t{200});
}

/// Stops the writer between any two steps of a write, so that the test can read meanwhile.
struct Stop {
  static void pause() noexcept {
    if (read_meanwhile) read_meanwhile();
  }
  static thread_local std::function<void()> read_meanwhile;
};
thread_local std::function<void()> Stop::read_meanwhile{};

/// The number of a write, and one step for each of its words.
constexpr int kPauseCount = 1 + 14;

TEST(Latest, GivesTheFormerValueAtEveryStepOfAWrite) {
  Latest<Sample, Stop> latest;
  int step_count = 0;
  Stop::read_meanwhile = [&] {
    ++step_count;
    EXPECT_FALSE(latest.read()) << "there is no value before the first";
  };
  latest.write(sample_of(1));
  EXPECT_EQ(step_count, kPauseCount);
  // These writes fill every slot twice.
  for (std::uint64_t number = 2; number <= 2 * latest.kSlotCount + 1; ++number) {
    Stop::read_meanwhile = [&] {
      ++step_count;
      const auto sample = latest.read();
      ASSERT_TRUE(sample) << "while " << number << " is written";
      EXPECT_TRUE(is_whole(*sample));
      EXPECT_EQ(sample->words[0], number - 1);
      EXPECT_EQ(latest.count(), number - 1);
    };
    latest.write(sample_of(number));
    EXPECT_EQ(step_count, static_cast<int>(number) * kPauseCount);
    EXPECT_EQ(latest.read()->words[0], number);
  }
  Stop::read_meanwhile = {};
}

TEST(Latest, GivesConcurrentReadersWholeValuesInOrder) {
  // Each word of the reader's copy may come from another write; read() returns whole values only.
  constexpr int kReaderCount = 3;
  constexpr std::uint64_t kWriteCount = 100'000;
  Latest<Sample> latest;
  latest.write(sample_of(1));
  std::atomic<bool> is_done{false};
  std::atomic<std::uint64_t> wrong_count{0};
  std::vector<std::thread> readers;
  for (int i = 0; i < kReaderCount; ++i) {
    readers.emplace_back([&] {
      std::uint64_t newest = 0;
      while (!is_done.load(std::memory_order_acquire)) {
        const auto sample = latest.read();
        if (!sample || !is_whole(*sample) || sample->words[0] < newest) {
          ++wrong_count;
        } else {
          newest = sample->words[0];
        }
      }
    });
  }
  for (std::uint64_t number = 2; number <= kWriteCount; ++number)
    latest.write(sample_of(number));
  is_done.store(true, std::memory_order_release);
  for (std::thread& reader : readers)
    reader.join();
  EXPECT_EQ(wrong_count, 0u);
}

}  // namespace
}  // namespace rtpm
