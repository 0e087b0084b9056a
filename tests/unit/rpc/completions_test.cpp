#include "rtpm/rpc/completions.hpp"

#include <gtest/gtest.h>
#include <poll.h>
#include <sys/resource.h>

#include <sstream>
#include <string>

#include "deferring_servant.hpp"
#include "rtpm/test/child.hpp"
#include "rtpm/test/echo_server.hpp"
#include "rtpm/test/syscall_counter.hpp"

// The cost of waiting for calls while nothing happens. In a process of its own: see
// syscalls_test.cpp.
namespace rtpm::rpc {
namespace {

using namespace test;
using namespace std::chrono_literals;

constexpr const char* kMayNot = "seccomp's notifications are not to be had here";

/// The system calls of a thread that waits 200 ms for two calls that do not end, as text.
std::string count_while_idle(Transport transport, bool is_by_descriptor) {
  auto& counter = *new rtpm::test::SyscallCounter;
  DeferringServant servant;
  auto server = std::move(*Server::create(quiet_config()));
  if (!server->add("echo", servant) || !server->start()) return "there is no server";
  Node node(quiet_node(transport));
  auto binding = Binding::bind(node, server->url("echo"), echo::kInterface, {.deadline = 20s});
  if (!binding) return binding.error().text();
  Completions completions;
  int reply_count = 0;
  for (int i = 0; i < 2; ++i) {
    completions.then(binding->begin(echo::kEcho, {}),
                     [&](const auto& reply) { reply_count += reply ? 1 : 0; });
  }
  DeferredReply first = servant.reply();
  DeferredReply second = servant.reply();
  static_cast<void>(completions.poll());
  counter.watch_this_thread();
  if (!counter.may_watch()) return kMayNot;
  counter.count(true);
  const MonotonicTime end = rt::now() + 200ms;
  if (!is_by_descriptor) static_cast<void>(completions.wait(end));
  while (rt::now() < end) {
    pollfd entry{*completions.descriptor(), POLLIN, 0};
    if (poll(&entry, 1, static_cast<int>((end - rt::now()) / 1ms) + 1) > 0) {
      static_cast<void>(completions.poll());
    }
  }
  counter.count(false);
  first.complete(wire::Status::kOk, 0);
  second.complete(wire::Status::kOk, 0);
  while (completions.open_count() > 0)
    static_cast<void>(completions.wait(rt::now() + 20s));
  server->stop();
  return std::to_string(reply_count) + " " + std::to_string(counter.total()) + "\n" +
         counter.text("caller");
}

class IdleCompletions : public testing::TestWithParam<Transport> {};

TEST_P(IdleCompletions, PollNothing) {
  for (const bool is_by_descriptor : {true, false}) {
    const auto child =
        rtpm::test::run_in_child([&] { return count_while_idle(GetParam(), is_by_descriptor); });
    if (child.said == kMayNot) GTEST_SKIP() << kMayNot;
    std::istringstream words(child.said);
    int reply_count = 0;
    int syscall_count = 0;
    words >> reply_count >> syscall_count;
    EXPECT_EQ(reply_count, 2) << child.said << child.errors;
    EXPECT_GT(syscall_count, 0);
    // Over UDP, each of the two calls is repeated after 30 and 90 ms, perhaps once more. Polling
    // once a millisecond would take hundreds.
    EXPECT_LE(syscall_count, GetParam() == Transport::kUdp ? 80 : 6) << child.said;
  }
}

INSTANTIATE_TEST_SUITE_P(Udp, IdleCompletions, testing::Values(Transport::kUdp));
INSTANTIATE_TEST_SUITE_P(Tcp, IdleCompletions, testing::Values(Transport::kTcp));
INSTANTIATE_TEST_SUITE_P(SharedMemory, IdleCompletions, testing::Values(Transport::kSharedMemory));
INSTANTIATE_TEST_SUITE_P(Local, IdleCompletions, testing::Values(Transport::kLocal));

TEST(CompletionsTest, ReportThatNoDescriptorIsLeft) {
  const auto child = rtpm::test::run_in_child([]() -> std::string {
    EchoServer server;
    Node node(quiet_node());
    Binding binding = bind_echo(node, server);
    auto begun = binding.begin(echo::kEcho, {});
    const rlimit none{3, 3};
    setrlimit(RLIMIT_NOFILE, &none);
    Completions completions;
    std::string text;
    completions.then(std::move(begun), [&](const auto& reply) { text = to_string(reply.error()); });
    if (completions.wait(rt::now() + 20s) != 1) return "no callback";
    return text + completions.descriptor().error().text();
  });
  EXPECT_TRUE(child.said.starts_with(to_string(CallError::kNoResources))) << child.said;
  EXPECT_NE(child.said.find("ulimit -n"), std::string::npos) << child.said;
}

}  // namespace
}  // namespace rtpm::rpc
