#include <gtest/gtest.h>
#include <sys/syscall.h>

#include <array>
#include <atomic>
#include <map>
#include <memory>
#include <set>
#include <sstream>
#include <string>
#include <thread>

#include "rtpm/test/child.hpp"
#include "rtpm/test/echo_server.hpp"
#include "rtpm/test/syscall_counter.hpp"

// The system calls of an RTPM call. They are counted in a separate process, because a filter lasts
// as long as its thread.
namespace rtpm::rpc {
namespace {

using namespace test;
using rtpm::test::SyscallCounter;

/// A servant that starts to watch its lane's thread when it is first called.
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

/// The system calls of kCallCount RTPM calls, one line for each kind.
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

  /// Expects only system calls of these kinds.
  void expect_only(const std::map<int, int>& counts, const std::set<int>& kinds) const {
    for (const auto& [number, times] : counts)
      EXPECT_TRUE(kinds.contains(number)) << "system call " << number << " in\n" << text_;
  }

  std::map<int, int> caller_;
  std::map<int, int> lane_;
  std::string text_;
};

TEST_F(Syscalls, AreAbsentFromASpinningCallThroughMemory) {
  count(Transport::kSharedMemory, rt::WaitStrategy::kSpin);
  // Lane and caller check their sockets now and then, independently of the number of calls.
  caller_.erase(SYS_recvfrom);
  lane_.erase(SYS_epoll_pwait2);
  EXPECT_TRUE(caller_.empty()) << text_;
  EXPECT_TRUE(lane_.empty()) << text_;
}

TEST_F(Syscalls, AreOneWakeUpPerSideOfABlockingCallThroughMemory) {
  count(Transport::kSharedMemory, rt::WaitStrategy::kBlock);
  EXPECT_LE(caller_[SYS_sendto], kCallCount) << text_;
  EXPECT_GT(lane_[SYS_epoll_pwait2], 0) << "or nothing was counted";
  // The caller may have its answer, and begin to count, before the lane wakes it.
  EXPECT_LE(lane_[SYS_futex], kCallCount + 1) << text_;
  EXPECT_EQ(lane_[SYS_sendto], 0) << text_;
}

// A caller resends when an answer is late, which may happen because counting is slow.
constexpr int kAboutOneEach = kCallCount + kCallCount / 4;

TEST_F(Syscalls, AreSendsAndReceivesOfASpinningCallOverUdp) {
  count(Transport::kUdp, rt::WaitStrategy::kSpin);
  EXPECT_GE(caller_[SYS_sendto], kCallCount) << text_;
  EXPECT_LE(caller_[SYS_sendto], kAboutOneEach) << text_;
  EXPECT_LE(lane_[SYS_sendto], kAboutOneEach) << text_;
  expect_only(caller_, {SYS_sendto, SYS_recvfrom});
  expect_only(lane_, {SYS_sendto, SYS_recvfrom});
}

TEST_F(Syscalls, AreASendAndAReceivePerSideOfABlockingCallOverUdp) {
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

TEST_F(Syscalls, AreASendAReceiveAndAPollOfABlockingCallOverTcp) {
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
