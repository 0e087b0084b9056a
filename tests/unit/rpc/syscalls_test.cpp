#include <gtest/gtest.h>
#include <linux/audit.h>
#include <linux/filter.h>
#include <linux/seccomp.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <map>
#include <memory>
#include <set>
#include <sstream>
#include <string>
#include <thread>

#include "rtpm/test/child.hpp"
#include "rtpm/test/echo_server.hpp"

// What a call costs in system calls, which the kernel itself counts: a seccomp filter reports each
// one of a thread before it runs. A filter stays as long as its thread, so this is done in a
// process of its own.   Source: seccomp_unotify(2).
namespace rtpm::rpc {
namespace {

using namespace test;

/// Has the kernel report the calling thread's system calls to a descriptor; -1 where it may not.
int report_this_thread() {
  if (prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) != 0) return -1;
  std::array<sock_filter, 1> all{sock_filter{BPF_RET | BPF_K, 0, 0, SECCOMP_RET_USER_NOTIF}};
  const sock_fprog program{static_cast<unsigned short>(all.size()), all.data()};
  return static_cast<int>(
      syscall(SYS_seccomp, SECCOMP_SET_MODE_FILTER, SECCOMP_FILTER_FLAG_NEW_LISTENER, &program));
}

/// Counts what is reported, on a thread of its own that is not reported itself and that ends with
/// the process: who is watched gets no system call through without it.
class SyscallCounter {
 public:
  SyscallCounter() {
    std::thread([this] { run(); }).detach();
  }
  SyscallCounter(const SyscallCounter&) = delete;
  SyscallCounter& operator=(const SyscallCounter&) = delete;

  /// Of the calling thread, for good.
  void watch_this_thread() { descriptor_ = report_this_thread(); }
  [[nodiscard]] bool may_watch() const { return descriptor_ != -1; }
  /// From here on they count, or no more.
  void count(bool is_on) { is_counting_ = is_on; }
  [[nodiscard]] std::string text(const std::string& name) const {
    std::string text;
    for (const auto& [number, count] : counts_)
      text += name + " " + std::to_string(number) + " " + std::to_string(count) + "\n";
    return text;
  }

 private:
  void run() {
    while (descriptor_ == 0)
      std::this_thread::yield();
    while (descriptor_ > 0) {
      pollfd entry{descriptor_, POLLIN, 0};
      if (poll(&entry, 1, -1) <= 0) continue;
      seccomp_notif call{};
      if (ioctl(descriptor_, SECCOMP_IOCTL_NOTIF_RECV, &call) != 0) continue;
      if (is_counting_) ++counts_[call.data.nr];
      seccomp_notif_resp answer{};
      answer.id = call.id;
      answer.flags = SECCOMP_USER_NOTIF_FLAG_CONTINUE;
      ioctl(descriptor_, SECCOMP_IOCTL_NOTIF_SEND, &answer);
    }
  }

  std::atomic<int> descriptor_{0};
  std::atomic<bool> is_counting_{false};
  std::map<int, int> counts_;
};

/// A servant that has its lane's thread watched when it is first called.
class WatchingServant final : public Servant {
 public:
  explicit WatchingServant(SyscallCounter& counter) : counter_(counter) {}
  [[nodiscard]] const InterfaceDescriptor& interface() const noexcept override {
    return echo::kInterface;
  }
  DispatchResult dispatch(std::uint16_t, ConstBytes request, MutableBytes reply,
                          const CallContext&) override {
    if (!std::exchange(is_watched_, true)) counter_.watch_this_thread();
    std::ranges::copy(request, reply.begin());
    return {wire::Status::kOk, static_cast<std::uint32_t>(request.size())};
  }

 private:
  SyscallCounter& counter_;
  bool is_watched_ = false;
};

constexpr int kCallCount = 200;
constexpr const char* kMayNot = "seccomp's notifications are not to be had here";

/// The system calls of kCallCount calls, a line for each kind.
std::string count_in_this_process(Transport transport, rt::WaitStrategy wait) {
  auto& of_caller = *new SyscallCounter;
  auto& of_lane = *new SyscallCounter;
  WatchingServant servant(of_lane);
  LaneConfig lane;
  lane.wait.strategy = wait;
  auto server = std::move(*Server::create(quiet_config({lane})));
  if (!server->add("echo", servant) || !server->start()) return "there is no server";
  NodeConfig config = quiet_node(transport);
  config.wait.strategy = wait;
  std::string text;
  {
    Node node(config);
    auto binding = Binding::bind(node, server->url("echo"), echo::kInterface);
    if (!binding || !binding->call(echo::kEcho, {})) return "there is no answer";
    of_caller.watch_this_thread();
    if (!of_caller.may_watch() || !of_lane.may_watch()) return kMayNot;
    for (int i = 0; i < kCallCount + 10; ++i) {
      if (i == 10) {
        of_caller.count(true);
        of_lane.count(true);
      }
      if (!binding->call(echo::kEcho, {})) return "a call failed";
    }
    of_caller.count(false);
    of_lane.count(false);
  }
  server->stop();
  return of_caller.text("caller") + of_lane.text("lane") + "counted 0 0";
}

class Syscalls : public testing::Test {
 protected:
  void count(Transport transport, rt::WaitStrategy wait) {
    const auto child =
        rtpm::test::run_in_child([&] { return count_in_this_process(transport, wait); });
    if (child.said == kMayNot) GTEST_SKIP() << kMayNot;
    ASSERT_TRUE(child.said.ends_with("counted 0 0")) << child.said << child.errors;
    text_ = child.said;
    std::istringstream words(child.said);
    std::string who;
    int number = 0;
    int times = 0;
    while (words >> who >> number >> times) {
      if (who == "caller") caller_[number] = times;
      if (who == "lane") lane_[number] = times;
    }
  }

  /// No calls but of these kinds.
  void expect_only(const std::map<int, int>& counts, const std::set<int>& kinds) const {
    for (const auto& [number, times] : counts)
      EXPECT_TRUE(kinds.contains(number)) << "system call " << number << " in\n" << text_;
  }

  std::map<int, int> caller_;
  std::map<int, int> lane_;
  std::string text_;
};

TEST_F(Syscalls, AreNoneOfACallThroughMemoryThatIsSpunFor) {
  count(Transport::kSharedMemory, rt::WaitStrategy::kSpin);
  // Both look at their sockets now and then, however many calls there are.
  caller_.erase(SYS_recvfrom);
  lane_.erase(SYS_epoll_pwait2);
  EXPECT_TRUE(caller_.empty()) << text_;
  EXPECT_TRUE(lane_.empty()) << text_;
}

TEST_F(Syscalls, OfACallThroughMemoryThatBlocksAreOneWakeUpASide) {
  count(Transport::kSharedMemory, rt::WaitStrategy::kBlock);
  EXPECT_LE(caller_[SYS_sendto], kCallCount) << text_;
  EXPECT_GT(lane_[SYS_epoll_pwait2], 0) << "or nothing was counted";
  // The caller may have its answer, and begin to count, before the lane comes to wake it.
  EXPECT_LE(lane_[SYS_futex], kCallCount + 1) << text_;
  EXPECT_EQ(lane_[SYS_sendto], 0) << text_;
}

// A late answer makes a caller send again, which it may where the counting takes so long.
constexpr int kAboutOneEach = kCallCount + kCallCount / 4;

TEST_F(Syscalls, OfACallOverUdpThatIsSpunForAreASendASideAndReceives) {
  count(Transport::kUdp, rt::WaitStrategy::kSpin);
  EXPECT_GE(caller_[SYS_sendto], kCallCount) << text_;
  EXPECT_LE(caller_[SYS_sendto], kAboutOneEach) << text_;
  EXPECT_LE(lane_[SYS_sendto], kAboutOneEach) << text_;
  expect_only(caller_, {SYS_sendto, SYS_recvfrom});
  expect_only(lane_, {SYS_sendto, SYS_recvfrom});
}

TEST_F(Syscalls, OfACallOverUdpThatBlocksAreASendAndAReceiveOfTheLane) {
  count(Transport::kUdp, rt::WaitStrategy::kBlock);
  EXPECT_GE(caller_[SYS_sendto], kCallCount) << text_;
  EXPECT_LE(caller_[SYS_sendto], kAboutOneEach) << text_;
  EXPECT_LE(caller_[SYS_recvfrom], kAboutOneEach) << text_;
  EXPECT_LE(caller_[SYS_ppoll], kAboutOneEach) << text_;
  expect_only(caller_, {SYS_sendto, SYS_recvfrom, SYS_ppoll});
  EXPECT_LE(lane_[SYS_sendto], kAboutOneEach) << text_;
  EXPECT_LE(lane_[SYS_recvfrom], kAboutOneEach) << text_;
  expect_only(lane_, {SYS_sendto, SYS_recvfrom});
}

TEST_F(Syscalls, OfACallOverTcpThatBlocksAreASendAndAReceiveASideAndAPollOfTheLane) {
  count(Transport::kTcp, rt::WaitStrategy::kBlock);
  EXPECT_EQ(caller_[SYS_sendto], kCallCount) << text_;
  EXPECT_LE(caller_[SYS_recvfrom], kAboutOneEach) << text_;
  expect_only(caller_, {SYS_sendto, SYS_recvfrom});
  EXPECT_EQ(lane_[SYS_sendto], kCallCount) << text_;
  EXPECT_LE(lane_[SYS_recvfrom], kAboutOneEach) << text_;
  EXPECT_LE(lane_[SYS_ppoll], kAboutOneEach) << text_;
  expect_only(lane_, {SYS_sendto, SYS_recvfrom, SYS_ppoll});
}

}  // namespace
}  // namespace rtpm::rpc
