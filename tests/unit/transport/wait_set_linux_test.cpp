#include <gtest/gtest.h>
#include <linux/filter.h>
#include <pthread.h>
#include <signal.h>
#include <sys/eventfd.h>
#include <sys/resource.h>

#include <array>
#include <atomic>
#include <thread>

#include "os/linux/port_wait_set.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/test/os.hpp"
#include "rtpm/test/syscall_counter.hpp"
#include "wait_set_suite.hpp"

// The wait sets of Linux promise more.
namespace rtpm::transport {
namespace {

using namespace test;
using rtpm::test::SyscallCounter;
using namespace std::chrono_literals;

class LinuxWaitSetTest : public WaitSetTest {};
class WaitSetThatReceives : public WaitSetTest {
 protected:
  [[nodiscard]] bool only_polls() const {
    return static_cast<const PortWaitSet&>(*set_).only_polls();
  }
};

TEST_P(LinuxWaitSetTest, ReportsAnEdgeSourceOncePerSignal) {
  const Descriptor event(eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC));
  const SourceTag tag(kSocket, 1);
  ASSERT_EQ(eventfd_write(event.number(), 1), 0);
  ASSERT_TRUE(set_->add(event.number(), tag, Trigger::kEdge));
  EXPECT_EQ(await_some(), tags_of({tag})) << "of the signal before";
  EXPECT_EQ(poll(), Tags{});
  ASSERT_EQ(eventfd_write(event.number(), 1), 0);
  EXPECT_EQ(poll(), tags_of({tag}));
  EXPECT_EQ(poll(), Tags{});
  set_->remove(event.number());
}

TEST_P(LinuxWaitSetTest, TakesOneSystemCall) {
  if (rtpm::test::kHasSanitizer) GTEST_SKIP() << "sanitizers make system calls of their own";
  constexpr int kCount = 20;
  SyscallCounter counter;
  bool may_count = false;
  std::thread watched([&] {
    counter.watch_this_thread();
    may_count = counter.may_watch();
    if (!may_count) return;
    for (int round = 0; round < 2; ++round) {
      counter.count(round == 1);
      for (int i = 0; i < kCount / 2; ++i) {
        static_cast<void>(poll());
        static_cast<void>(wait(rt::now() + 100us));
      }
    }
    counter.count(false);
  });
  watched.join();
  if (!may_count) GTEST_SKIP() << "seccomp's notifications are not to be had here";
  EXPECT_EQ(counter.total(), kCount);
}

TEST_P(LinuxWaitSetTest, SurvivesAStormOfSignals) {
  struct sigaction action {};
  action.sa_handler = [](int) {};
  struct sigaction former {};
  ASSERT_EQ(sigaction(SIGUSR1, &action, &former), 0);
  std::atomic<bool> is_over = false;
  const pthread_t waiter = pthread_self();
  std::thread storm([&] {
    while (!is_over) {
      pthread_kill(waiter, SIGUSR1);
      std::this_thread::yield();
    }
  });
  for (int i = 0; i < 20; ++i) {
    const MonotonicTime until = rt::now() + 300us;
    while (rt::now() < until)
      EXPECT_EQ(wait(until), Tags{});
    set_->ring();
    EXPECT_EQ(await_some(), tags_of({kDoorbell}));
    drain();
  }
  is_over = true;
  storm.join();
  sigaction(SIGUSR1, &former, nullptr);
}

// A packet filter that drops the doorbell's datagrams delays one ring, not all.
TEST_P(WaitSetThatReceives, OnlyPollsAfterALostDoorbellDatagram) {
  std::array<sock_filter, 1> none{sock_filter{BPF_RET | BPF_K, 0, 0, 0}};
  const sock_fprog program{static_cast<unsigned short>(none.size()), none.data()};
  ASSERT_EQ(setsockopt(port_->descriptor(), SOL_SOCKET, SO_ATTACH_FILTER, &program, sizeof program),
            0);
  EXPECT_FALSE(only_polls());
  std::atomic<bool> is_over = false;
  std::thread other([&] {
    while (!is_over) {
      set_->ring();
      std::this_thread::yield();
    }
  });
  for (const MonotonicTime end = rt::now() + 10s; !only_polls() && rt::now() < end;)
    static_cast<void>(wait(end));
  is_over = true;
  other.join();
  EXPECT_TRUE(only_polls());
  static_cast<void>(poll());
  std::thread last([this] { set_->ring(); });
  EXPECT_EQ(await_some(), tags_of({kDoorbell}));
  last.join();
}

INSTANTIATE_TEST_SUITE_P(All, LinuxWaitSetTest, testing::ValuesIn(ways(kAllKinds, {false, true})),
                         name_of);
INSTANTIATE_TEST_SUITE_P(All, WaitSetThatReceives,
                         testing::ValuesIn(ways(std::array{Kind::kPortAlone}, {false})), name_of);

}  // namespace
}  // namespace rtpm::transport
