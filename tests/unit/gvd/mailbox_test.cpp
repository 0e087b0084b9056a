#include "mailbox.hpp"

#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <barrier>
#include <thread>
#include <utility>
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

constexpr auto kAlways = [] { return true; };

MailOutcome put(Mailbox<Letter>& mailbox, std::uint32_t number, std::uint16_t writer = 1) {
  return mailbox.put({writer, number}, letter(number), kAlways);
}

TEST(Mailbox, GivesTheNewestOnce) {
  Mailbox<Letter> mailbox;
  EXPECT_FALSE(mailbox.take());
  EXPECT_EQ(put(mailbox, 1), MailOutcome::kPut);
  EXPECT_EQ(put(mailbox, 2), MailOutcome::kPut);
  EXPECT_EQ(put(mailbox, 3), MailOutcome::kPut);
  EXPECT_EQ(mailbox.take()->number, 3u);
  EXPECT_FALSE(mailbox.take());
  EXPECT_EQ(put(mailbox, 4), MailOutcome::kPut);
  EXPECT_EQ(mailbox.take()->number, 4u);
}

TEST(Mailbox, RefusesWhatIsNotNewerThanItsWritersLast) {
  Mailbox<Letter> mailbox;
  EXPECT_EQ(put(mailbox, 0), MailOutcome::kPut) << "any number is newer than none";
  EXPECT_EQ(put(mailbox, 0xffffffff), MailOutcome::kOld);
  EXPECT_EQ(put(mailbox, 5), MailOutcome::kPut);
  EXPECT_EQ(mailbox.take()->number, 5u);
  EXPECT_EQ(put(mailbox, 5), MailOutcome::kOld) << "also when that was taken";
  EXPECT_EQ(put(mailbox, 4), MailOutcome::kOld);
  EXPECT_FALSE(mailbox.take());
  EXPECT_EQ(put(mailbox, 1, 2), MailOutcome::kPut) << "another writer counts anew";
  EXPECT_EQ(put(mailbox, 0x7fffffff, 3), MailOutcome::kPut);
  EXPECT_EQ(put(mailbox, 0xfffffffe, 3), MailOutcome::kPut);
  EXPECT_EQ(put(mailbox, 1, 3), MailOutcome::kPut) << "the counter wraps";
}

TEST(Mailbox, IgnoresAWriterThatIsNotAllowed) {
  Mailbox<Letter> mailbox;
  EXPECT_EQ(mailbox.put({1, 1}, letter(1), [] { return false; }), MailOutcome::kRefused);
  EXPECT_FALSE(mailbox.take());
}

// A writer checks its permission in the middle of its put: there the test stops it.

TEST(Mailbox, IsNotBlockedByAWriterThatStopsMidway) {
  Mailbox<Letter> mailbox;
  int ask_count = 0;
  const auto outcome = mailbox.put({1, 1}, letter(1), [&] {
    if (++ask_count == 1) {
      for (std::uint32_t number = 2; number <= 100; ++number) {
        EXPECT_EQ(put(mailbox, number), MailOutcome::kPut);
        const auto taken = mailbox.take();
        EXPECT_TRUE(taken && taken->number == number);
      }
    }
    return true;
  });
  EXPECT_EQ(outcome, MailOutcome::kOld) << "what came late replaces nothing newer";
  EXPECT_FALSE(mailbox.take());
}

TEST(Mailbox, IgnoresAFormerWriterThatGoesOn) {
  Mailbox<Letter> mailbox;
  bool is_former_allowed = true;
  const auto outcome = mailbox.put({1, 1}, letter(1), [&] {
    const bool was_allowed = std::exchange(is_former_allowed, false);
    if (was_allowed) {
      EXPECT_EQ(put(mailbox, 7, 2), MailOutcome::kPut);
    }
    return was_allowed;
  });
  EXPECT_EQ(outcome, MailOutcome::kRefused);
  EXPECT_EQ(mailbox.take()->number, 7u);
}

TEST(Mailbox, IsBusyOnlyWhenEverySlotIsInUse) {
  Mailbox<Letter> mailbox;
  constexpr std::uint32_t kCount = Mailbox<Letter>::kSlotCount;
  std::atomic<int> stopped_count{0};
  std::barrier go_on(kCount);
  std::vector<std::thread> writers;
  // Stopped writers own all slots but one, and the waiting value has the last.
  for (std::uint32_t i = 1; i < kCount; ++i) {
    writers.emplace_back([&, i] {
      bool has_stopped = false;
      static_cast<void>(mailbox.put({1, i}, letter(i), [&] {
        if (!std::exchange(has_stopped, true)) {
          ++stopped_count;
          go_on.arrive_and_wait();
        }
        return true;
      }));
    });
  }
  while (stopped_count < static_cast<int>(kCount) - 1)
    std::this_thread::yield();
  EXPECT_EQ(put(mailbox, kCount), MailOutcome::kPut);
  EXPECT_EQ(put(mailbox, kCount + 1), MailOutcome::kBusy);
  EXPECT_EQ(mailbox.take()->number, kCount);
  EXPECT_EQ(put(mailbox, kCount + 1), MailOutcome::kPut);
  go_on.arrive_and_wait();
  for (std::thread& writer : writers)
    writer.join();
  for (std::uint32_t number = kCount + 2; number < 3 * kCount; ++number)
    EXPECT_EQ(put(mailbox, number), MailOutcome::kPut) << "every slot came back";
  EXPECT_EQ(mailbox.take()->number, 3 * kCount - 1);
}

TEST(Mailbox, NeverTearsOrGoesBackBetweenManyWritersAndOneReader) {
  Mailbox<Letter> mailbox;
  constexpr std::uint32_t kLast = 20000;
  std::atomic<std::uint32_t> next{0};
  std::vector<std::thread> writers;
  writers.reserve(3);
  for (int i = 0; i < 3; ++i) {
    writers.emplace_back([&] {
      while (true) {
        const std::uint32_t number = ++next;
        if (number > kLast) return;
        MailOutcome outcome = put(mailbox, number);
        while (outcome == MailOutcome::kBusy)
          outcome = put(mailbox, number);
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
