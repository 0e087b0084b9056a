#include "rtpm/gvd/mailbox.hpp"

#include <gtest/gtest.h>

#include <array>
#include <thread>
#include <vector>

namespace rtpm::gvd {
namespace {

struct Letter {
  std::uint64_t number = 0;
  std::array<std::uint64_t, 15> copies{};
};

Letter letter(std::uint64_t number) {
  Letter letter{number, {}};
  letter.copies.fill(number);
  return letter;
}

bool put(Mailbox<Letter>& mailbox, std::uint64_t number) {
  return mailbox.put([&](const Letter&) -> std::optional<Letter> { return letter(number); });
}

TEST(Mailbox, GivesTheNewestOnce) {
  Mailbox<Letter> mailbox;
  EXPECT_FALSE(mailbox.take());
  EXPECT_TRUE(put(mailbox, 1));
  EXPECT_TRUE(put(mailbox, 2));
  EXPECT_TRUE(put(mailbox, 3));
  EXPECT_EQ(mailbox.take()->number, 3u);
  EXPECT_FALSE(mailbox.take());
  EXPECT_TRUE(put(mailbox, 4));
  EXPECT_EQ(mailbox.take()->number, 4u);
}

TEST(Mailbox, LetsTheWriterCompareWithTheLast) {
  Mailbox<Letter> mailbox;
  EXPECT_TRUE(put(mailbox, 5));
  EXPECT_TRUE(mailbox.take());
  EXPECT_TRUE(mailbox.put([](const Letter& last) -> std::optional<Letter> {
    EXPECT_EQ(last.number, 5u);
    return std::nullopt;
  }));
  EXPECT_FALSE(mailbox.take()) << "nothing was put";
}

TEST(Mailbox, NeverTearsOrGoesBackBetweenManyWritersAndOneReader) {
  Mailbox<Letter> mailbox;
  constexpr std::uint64_t kLast = 20000;
  std::vector<std::thread> writers;
  writers.reserve(3);
  for (int i = 0; i < 3; ++i) {
    writers.emplace_back([&] {
      std::uint64_t last_number = 0;
      while (last_number < kLast) {
        static_cast<void>(mailbox.put([&](const Letter& last) -> std::optional<Letter> {
          last_number = last.number;
          return letter(last.number + 1);
        }));
      }
    });
  }
  std::uint64_t newest = 0;
  while (newest < kLast) {
    const auto taken = mailbox.take();
    if (!taken) continue;
    ASSERT_GT(taken->number, newest);
    for (const std::uint64_t copy : taken->copies)
      ASSERT_EQ(copy, taken->number);
    newest = taken->number;
  }
  for (std::thread& writer : writers)
    writer.join();
}

}  // namespace
}  // namespace rtpm::gvd
