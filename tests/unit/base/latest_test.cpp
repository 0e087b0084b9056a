#include "rtpm/base/latest.hpp"

#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <cstdint>
#include <thread>

namespace rtpm {
namespace {

/// A state whose words must all be equal: a torn copy shows.
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

TEST(Latest, HasNothingBeforeTheFirstWrite) {
  const Latest<Sample> latest;
  EXPECT_FALSE(latest.read());
  EXPECT_EQ(latest.count(), 0u);
}

TEST(Latest, GivesTheNewestValueAgainAndAgain) {
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

TEST(Latest, AReaderBesideTheWriterSeesWholeValuesThatNeverGoBack) {
  constexpr std::uint64_t kWriteCount = 200'000;
  Latest<Sample> latest;
  std::atomic<bool> is_done{false};
  std::thread writer([&] {
    for (std::uint64_t number = 1; number <= kWriteCount; ++number)
      latest.write(sample_of(number));
    is_done.store(true, std::memory_order_release);
  });
  std::uint64_t newest = 0;
  std::uint64_t torn_count = 0;
  std::uint64_t backward_count = 0;
  bool is_last = false;
  while (!is_last) {
    is_last = is_done.load(std::memory_order_acquire);
    const auto sample = latest.read();
    if (!sample) continue;
    if (!is_whole(*sample)) ++torn_count;
    if (sample->words[0] < newest) ++backward_count;
    newest = sample->words[0];
  }
  writer.join();
  EXPECT_EQ(torn_count, 0u);
  EXPECT_EQ(backward_count, 0u);
  EXPECT_EQ(newest, kWriteCount) << "after the last write the last value is there";
}

}  // namespace
}  // namespace rtpm
