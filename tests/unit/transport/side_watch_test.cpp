#include "side_watch.hpp"

#include <gtest/gtest.h>
#include <linux/audit.h>
#include <linux/filter.h>
#include <linux/seccomp.h>
#include <sys/eventfd.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <cstddef>
#include <string>
#include <thread>

#include "frames.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/test/child.hpp"

namespace rtpm::transport {
namespace {

using namespace test;
using namespace std::chrono_literals;

constexpr const char* kNoRing = "io_uring is not to be had here";

class SideWatchTest : public testing::Test {
 protected:
  void SetUp() override {
    watch_ = SideWatch::open();
    if (watch_ == nullptr) GTEST_SKIP() << kNoRing;
    limit_blocking(near_.number(), 500ms);
  }
  bool begin() { return watch_->begin(std::array{event_.number()}); }
  void signal() { EXPECT_EQ(eventfd_write(event_.number(), 1), 0); }
  void take_signals() {
    eventfd_t count = 0;
    EXPECT_EQ(eventfd_read(event_.number(), &count), 0);
  }
  /// What a receive gives, or the error that it ends with, negative.
  int receive() {
    std::byte byte{};
    const ssize_t count = recv(near_.number(), &byte, 1, 0);
    return count >= 0 ? static_cast<int>(count) : -errno;
  }

  std::unique_ptr<SideWatch> watch_;
  Descriptor event_{eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC)};
  std::pair<Descriptor, Descriptor> ends_ = stream_pair();
  Descriptor& near_ = ends_.first;
  Descriptor& far_ = ends_.second;
};

TEST_F(SideWatchTest, EndsAReceiveThatBlocks) {
  ASSERT_TRUE(begin());
  EXPECT_FALSE(watch_->has_news());
  std::thread other([this] {
    std::this_thread::sleep_for(5ms);
    signal();
  });
  EXPECT_EQ(receive(), -EINTR);
  EXPECT_TRUE(watch_->has_news());
  EXPECT_TRUE(watch_->has_news()) << "until the next begin";
  other.join();
}

TEST_F(SideWatchTest, EndsAReceiveThatHasNotBegun) {
  ASSERT_TRUE(begin());
  std::thread([this] { signal(); }).join();
  // Either it is known by now, or the receive ends for it.
  EXPECT_TRUE(watch_->has_news() || receive() == -EINTR);
  EXPECT_TRUE(watch_->has_news());
}

TEST_F(SideWatchTest, TellsOfWhatWasThereBefore) {
  signal();
  ASSERT_TRUE(begin());
  EXPECT_TRUE(watch_->has_news());
}

TEST_F(SideWatchTest, LeavesAReceiveAloneThatHasSomething) {
  ASSERT_TRUE(begin());
  write_all(far_, Bytes(1));
  EXPECT_EQ(receive(), 1);
  EXPECT_FALSE(watch_->has_news());
}

TEST_F(SideWatchTest, IsSilentAfterItsEnd) {
  ASSERT_TRUE(begin());
  watch_->end();
  EXPECT_FALSE(watch_->is_on());
  signal();
  // It would learn of it in a system call, at the latest.
  static_cast<void>(getppid());
  EXPECT_FALSE(watch_->has_news());
  take_signals();
  ASSERT_TRUE(begin());
  EXPECT_FALSE(watch_->has_news()) << "what came in between is over";
}

TEST_F(SideWatchTest, LetsGoOfWhatItWatchedAtItsEnd) {
  auto [watched, peer] = stream_pair();
  ASSERT_TRUE(watch_->begin(std::array{watched.number()}));
  watch_->end();
  watched = Descriptor{};
  std::byte byte{};
  EXPECT_EQ(recv(peer.number(), &byte, 1, 0), 0) << "the watched end is still open";
}

TEST_F(SideWatchTest, BeginsAndEndsAnyNumberOfTimes) {
  for (int round = 0; round < 2000; ++round) {
    ASSERT_TRUE(watch_->begin(std::array{event_.number(), near_.number()})) << round;
    ASSERT_FALSE(watch_->has_news()) << round;
    if (round % 3 == 1) signal();
    if (round % 3 == 2) write_all(far_, Bytes(1));
    // It learns of it in a system call, at the latest.
    static_cast<void>(getppid());
    ASSERT_EQ(watch_->has_news(), round % 3 != 0) << round;
    if (round % 3 == 1) take_signals();
    const int expected = round % 3 == 2 ? 1 : -EAGAIN;
    std::byte byte{};
    const ssize_t count = recv(near_.number(), &byte, 1, MSG_DONTWAIT);
    ASSERT_EQ(count >= 0 ? static_cast<int>(count) : -errno, expected);
    watch_->end();
  }
}

TEST_F(SideWatchTest, HearsEverySignalWhileItReceives) {
  constexpr int kSignalCount = 2000;
  std::atomic<int> heard_count = 0;
  std::thread other([&] {
    for (int i = 0; i < kSignalCount; ++i) {
      signal();
      if (i % 3 == 0) write_all(far_, Bytes(1));
      while (heard_count <= i)
        std::this_thread::yield();
    }
  });
  int unheard_count = 0;
  while (heard_count < kSignalCount) {
    ASSERT_TRUE(watch_->is_on() || begin());
    if (!watch_->has_news() && receive() == -EAGAIN) ++unheard_count;
    if (!watch_->has_news()) continue;
    watch_->end();
    take_signals();
    // What came beside it makes room.
    std::byte byte{};
    while (recv(near_.number(), &byte, 1, MSG_DONTWAIT) > 0) {
    }
    ++heard_count;
  }
  other.join();
  EXPECT_EQ(unheard_count, 0) << "a receive ended in its own time";
}

/// Has the system refuse a system call to this process from here on.
bool forbid(int number) {
  std::array filter{
      sock_filter{BPF_LD | BPF_W | BPF_ABS, 0, 0, offsetof(seccomp_data, nr)},
      sock_filter{BPF_JMP | BPF_JEQ | BPF_K, 0, 1, static_cast<std::uint32_t>(number)},
      sock_filter{BPF_RET | BPF_K, 0, 0, SECCOMP_RET_ERRNO | EPERM},
      sock_filter{BPF_RET | BPF_K, 0, 0, SECCOMP_RET_ALLOW}};
  const sock_fprog program{static_cast<unsigned short>(filter.size()), filter.data()};
  return prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) == 0 &&
         syscall(SYS_seccomp, SECCOMP_SET_MODE_FILTER, 0, &program) == 0;
}

TEST(SideWatch, IsNotToBeHadWhereTheSystemForbidsIt) {
  const auto child = rtpm::test::run_in_child([]() -> std::string {
    if (!forbid(SYS_io_uring_setup)) return "may not forbid";
    return SideWatch::open() == nullptr ? "none" : "one";
  });
  if (child.said == "may not forbid") GTEST_SKIP() << "seccomp's filters are not to be had here";
  EXPECT_EQ(child.said, "none") << child.errors;
}

TEST(SideWatch, ClosesWhereTheSystemRefusesLater) {
  const auto child = rtpm::test::run_in_child([]() -> std::string {
    const auto watch = SideWatch::open();
    if (watch == nullptr) return kNoRing;
    if (!forbid(SYS_io_uring_enter)) return "may not forbid";
    const Descriptor event{eventfd(0, EFD_CLOEXEC)};
    if (watch->begin(std::array{event.number()})) return "it begins";
    watch->end();
    return watch->is_open() || watch->is_on() ? "it is open" : "closed";
  });
  if (child.said == "may not forbid") GTEST_SKIP() << "seccomp's filters are not to be had here";
  if (child.said == kNoRing) GTEST_SKIP() << kNoRing;
  EXPECT_EQ(child.said, "closed") << child.errors;
}

}  // namespace
}  // namespace rtpm::transport
