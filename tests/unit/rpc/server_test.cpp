#include "rtpm/rpc/server.hpp"

#include <gtest/gtest.h>
#include <sched.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "rtpm/rt/budget.hpp"
#include "rtpm/rt/host.hpp"
#include "rtpm/rt/report.hpp"
#include "rtpm/test/child.hpp"
#include "rtpm/test/echo_server.hpp"
#include "rtpm/transport/client_transport.hpp"
#include "rtpm/transport/tcp.hpp"
#include "rtpm/transport/udp.hpp"
#include "rtpm/wire/limits.hpp"
#include "rtpm/wire/url.hpp"

namespace rtpm::rpc {
namespace {

using namespace test;
using namespace std::chrono_literals;

/// The error text of a failed set-up; empty if it succeeds.
std::string error_of(ServerConfig config) {
  const auto server = Server::create(std::move(config));
  return server ? "" : server.error().text();
}

TEST(ServerSetUp, ChoosesAPortForUdpAndTcp) {
  const auto server = Server::create(quiet_config());
  ASSERT_TRUE(server);
  EXPECT_NE((*server)->port(), 0);
  EXPECT_EQ((*server)->url("lab/arm0"),
            "rtpm://127.0.0.1:" + std::to_string((*server)->port()) + "/lab/arm0");
  EXPECT_TRUE(wire::parse_url((*server)->url("lab/arm0")));
  EXPECT_FALSE(transport::TcpListener::open("127.0.0.1", (*server)->port()));
  EXPECT_FALSE(transport::UdpPort::open({.port = (*server)->port()}));
}

TEST(ServerSetUp, ListensAtTheAddressesOfAHostName) {
  ServerConfig config = quiet_config();
  config.host = "localhost";
  const auto server = Server::create(config);
  ASSERT_TRUE(server) << server.error().text();
  EXPECT_EQ(wire::parse_url((*server)->url("lab/arm0"))->hosts.front(), "127.0.0.1");
  config.host = "no-such-host.invalid";
  expect_text(error_of(config), {"server 'test'", "host 'no-such-host.invalid'", "Remedy"});
}

// Rejected callers learn nothing more, so the server must inform its own user.
TEST(ServerLife, WarnsOnceWhenNoDescriptorIsFree) {
  const rtpm::test::ChildResult child = rtpm::test::run_in_child([]() -> std::string {
    EchoServer server;
    std::vector<std::unique_ptr<transport::ClientTransport>> links;
    const auto open = [&] {
      auto link = transport::open_tcp_transport("127.0.0.1", server.server->port(), 0, 1000,
                                                rt::now() + 20s);
      if (link) links.push_back(std::move(*link));
      return link.has_value();
    };
    const rlimit few{64, 64};
    setrlimit(RLIMIT_NOFILE, &few);
    std::vector<int> held;
    for (int held_next = dup(STDERR_FILENO); held_next >= 0; held_next = dup(STDERR_FILENO))
      held.push_back(held_next);
    for (int i = 0; i < 4; ++i) {
      // Frees a descriptor for the caller's end, which is in this process, too.
      close(held.back());
      held.pop_back();
      if (!open()) return "no caller";
      if (!transport::wait_readable(links.back()->descriptor(), rt::now() + 20s)) {
        return "a caller waits";
      }
    }
    return "";
  });
  EXPECT_EQ(child.said, "");
  EXPECT_EQ(child.status, 0) << child.errors;
  expect_text(child.errors, {"rtpm: warning: a connection over TCP is turned away",
                             "Too many open files", "Remedy: raise the limit of open files"});
  EXPECT_EQ(std::ranges::count(child.errors, '\n'), 1) << child.errors;
}

TEST(ServerSetUp, ReportsABusyPortWithTheRemedy) {
  const auto first = Server::create(quiet_config());
  ASSERT_TRUE(first);
  ServerConfig config = quiet_config();
  config.name = "second";
  config.port = (*first)->port();
  expect_text(error_of(config),
              {"server 'second'", std::to_string(config.port), "Address already in use", "Remedy"});
}

TEST(ServerSetUp, ReportsABusyUdpPort) {
  std::uint16_t port = 0;
  {
    const auto listener = transport::TcpListener::open("127.0.0.1", 0);
    ASSERT_TRUE(listener);
    port = listener->port();
  }
  const auto taken = transport::UdpPort::open({.port = port});
  ASSERT_TRUE(taken);
  ServerConfig config = quiet_config();
  config.port = port;
  expect_text(error_of(config),
              {"server 'test'", "UDP 127.0.0.1:" + std::to_string(port), "Remedy"});
}

TEST(ServerSetUp, ReportsAnAddressOfAnotherHost) {
  ServerConfig config = quiet_config();
  config.host = "192.0.2.1";
  config.security.is_insecure = true;
  expect_text(error_of(config), {"server 'test'", "192.0.2.1", "Remedy"});
}

TEST(ServerSetUp, AcceptsLanesInAnyOrder) {
  EXPECT_EQ(error_of(quiet_config({quiet_lane(20'000), quiet_lane(0), quiet_lane(100)})), "");
}

TEST(ServerSetUp, RefusesInvalidLanes) {
  std::vector<LaneConfig> too_many;
  for (int i = 0; i < 65; ++i)
    too_many.push_back(quiet_lane(i));
  for (const auto& [lanes, part] : std::vector<std::pair<std::vector<LaneConfig>, std::string>>{
           {{quiet_lane(100), quiet_lane(200)}, "below 100"},
           {{quiet_lane(0), quiet_lane(100), quiet_lane(100)}, "100"},
           {too_many, "64 lanes"}}) {
    expect_text(error_of(quiet_config(lanes)), {"server 'test'", part, "Remedy"});
  }
}

// A bad value in a configuration file is a user's mistake, not a bug.
TEST(ServerSetUp, RefusesLimitsBeyondTheProtocol) {
  for (const std::uint32_t bad :
       {0u, wire::kMessageSizeFloor - 1, wire::kMessageSizeCeiling + 1, ~std::uint32_t{0}}) {
    ServerConfig config = quiet_config();
    config.message_size_max = bad;
    expect_text(error_of(config), {"server 'test'", "message_size_max", std::to_string(bad), "1024",
                                   "16777216", "Remedy"});
  }
  for (const std::uint32_t bad : {0u, 65'536u, ~std::uint32_t{0}}) {
    ServerConfig config = quiet_config();
    config.session_count_max = bad;
    expect_text(error_of(config),
                {"server 'test'", "session_count_max", std::to_string(bad), "65535", "Remedy"});
  }
  ServerConfig crowded = quiet_config();
  crowded.local_oneway_count_max = 4097;
  expect_text(error_of(crowded), {"server 'test'", "local_oneway_count_max", "4097", "Remedy"});
  for (const std::uint32_t good : {wire::kMessageSizeFloor, wire::kMessageSizeCeiling}) {
    ServerConfig config = quiet_config();
    config.message_size_max = good;
    config.session_count_max = 1;
    EXPECT_EQ(error_of(config), "");
  }
}

class ServerObjects : public testing::Test {
 protected:
  /// The error text of a failed add(); empty if it succeeds.
  std::string error_of_adding(const std::string& path, ObjectOptions options = {}) {
    const auto added = server_->add(path, servant_, options);
    return added ? "" : added.error().text();
  }
  static ServerConfig config() {
    ServerConfig config = quiet_config();
    config.ceiling = 20'000;
    return config;
  }

  echo::Servant servant_;
  std::unique_ptr<Server> server_ = std::move(*Server::create(config()));
};

TEST_F(ServerObjects, HaveWellFormedPaths) {
  EXPECT_EQ(error_of_adding("lab/arm0"), "");
  for (const std::string& bad : {std::string(), std::string("/lab"), std::string("lab//arm"),
                                 std::string("lab arm"), std::string(201, 'p')}) {
    expect_text(error_of_adding(bad), {"server 'test'", "'" + bad + "'", "malformed", "Remedy"});
  }
}

TEST_F(ServerObjects, HaveDistinctPaths) {
  EXPECT_EQ(error_of_adding("lab/arm0"), "");
  EXPECT_EQ(error_of_adding("lab/arm1"), "");
  expect_text(error_of_adding("lab/arm0"), {"server 'test'", "'lab/arm0'", "in use", "Remedy"});
}

TEST_F(ServerObjects, StayBelowTheCeiling) {
  EXPECT_EQ(error_of_adding("a", {.priority = 20'000}), "");
  for (const PriorityModel model :
       {PriorityModel::kClientPropagated, PriorityModel::kServerDeclared}) {
    expect_text(error_of_adding("b", {.model = model, .priority = 20'001}),
                {"server 'test'", "'b'", "20001", "20000", "Remedy"});
  }
}

TEST_F(ServerObjects, AreLimitedInNumber) {
  for (int i = 0; i < 1024; ++i)
    ASSERT_EQ(error_of_adding("object" + std::to_string(i)), "");
  expect_text(error_of_adding("one-more"), {"server 'test'", "'one-more'", "1024", "Remedy"});
}

TEST(ServerLife, StopsWithoutAStart) {
  const auto server = Server::create(quiet_config());
  ASSERT_TRUE(server);
  (*server)->stop();
  (*server)->stop();
  EXPECT_EQ((*server)->counters().call_count, 0u);
}

/// The CPUs of the thread with that name in this process.
std::vector<int> cpus_of_thread(const std::string& name) {
  const std::vector<pid_t> threads = rtpm::test::threads_named(name);
  EXPECT_EQ(threads.size(), 1u) << name;
  cpu_set_t set;
  CPU_ZERO(&set);
  sched_getaffinity(threads.at(0), sizeof set, &set);
  std::vector<int> cpus;
  for (int cpu = 0; cpu < CPU_SETSIZE; ++cpu) {
    if (CPU_ISSET(static_cast<std::size_t>(cpu), &set)) cpus.push_back(cpu);
  }
  return cpus;
}

// Behind a lane that spins at SCHED_FIFO the acceptor would never run.
TEST(ServerLife, KeepsItsAcceptorOffCpusOfSpinningLanes) {
  std::vector<int> cpus = rt::usable_cpus();
  if (cpus.size() < 2) GTEST_SKIP() << "there is one CPU only";
  LaneConfig lane = quiet_lane();
  lane.cpus = {cpus.back()};
  {
    EchoServer server(quiet_config({lane}));
    EXPECT_EQ(cpus_of_thread("rtpm-accept"), cpus) << "a lane that blocks is no hindrance";
  }
  lane.wait.strategy = rt::WaitStrategy::kSpin;
  EchoServer server(quiet_config({lane}));
  cpus.pop_back();
  EXPECT_EQ(cpus_of_thread("rtpm-accept"), cpus);
}

// This includes the threads that keep CPUs awake while lanes pause for the kernel's limit.
TEST(ServerLife, EndsAllThreadsWhenStopped) {
  const auto thread_count = [] {
    const std::filesystem::directory_iterator tasks("/proc/self/task");
    return std::distance(begin(tasks), end(tasks));
  };
  // ThreadSanitizer starts its own permanent thread with the program's first.
  std::thread([] {}).join();
  const auto before = thread_count();
  LaneConfig lane = quiet_lane();
  lane.cpus = {rt::usable_cpus().front()};
  ServerConfig config = quiet_config({lane});
  config.realtime = rt::RealtimeMode::kPrefer;
  EchoServer server(config);
  EXPECT_GT(thread_count(), before);
  server.server->stop();
  // A joined thread stays in the list for a moment.
  EXPECT_TRUE(await([&] { return thread_count() == before; }));
}

TEST(ServerLife, StopsTwiceAndKeepsItsCounters) {
  EchoServer server;
  Node node(quiet_node());
  Binding binding = bind_echo(node, server);
  EXPECT_TRUE(binding.call(echo::kEcho, {}));
  server.server->stop();
  server.server->stop();
  EXPECT_EQ(server.server->counters().call_count, 1u) << "the counters outlive the lanes";
}

TEST(ServerWithoutTheRight, DoesNotStartWhenRealTimeIsRequired) {
  const rtpm::test::ChildResult child = rtpm::test::run_in_child([]() -> std::string {
    rtpm::test::drop_realtime_rights(RLIM_INFINITY);
    ServerConfig config;
    config.name = "strict";
    config.realtime = rt::RealtimeMode::kRequire;
    const auto server = Server::create(config);
    if (!server) return server.error().text();
    const auto started = (*server)->start();
    return started ? "it started" : started.error().text();
  });
  expect_text(child.said, {"server 'strict'", "Remedy", "--realtime off"});
  EXPECT_EQ(child.status, 0) << child.errors;
}

// A lane that the kernel throttles does not spin; a server that requires spinning fails to start.
TEST(ServerSetUp, RefusesARequiredSpinningLaneThatTheKernelThrottles) {
  if (!rtpm::test::has_realtime_right()) GTEST_SKIP() << rtpm::test::kNoRealtimeRight;
  if (!rt::realtime_limit().is_limited()) GTEST_SKIP() << "the kernel throttles nothing here";
  const auto outcome_of = [](rt::RealtimeMode mode, rt::Schedule schedule) -> std::string {
    ServerConfig config;
    config.realtime = mode;
    LaneConfig lane;
    lane.name = "greedy";
    lane.wait.strategy = rt::WaitStrategy::kSpin;
    lane.schedule = schedule;
    config.lanes = {lane};
    const auto server = Server::create(config);
    if (!server) return server.error().text();
    const auto started = (*server)->start();
    return started ? "it started" : started.error().text();
  };
  expect_text(outcome_of(rt::RealtimeMode::kRequire, rt::Schedule::kFifo),
              {"greedy", "Remedy", "kernel.sched_rt_runtime_us=-1"});
  EXPECT_EQ(outcome_of(rt::RealtimeMode::kPrefer, rt::Schedule::kFifo), "it started");
  EXPECT_EQ(outcome_of(rt::RealtimeMode::kRequire, rt::Schedule::kTimeShared), "it started");
  EXPECT_EQ(std::ranges::count(rt::setup_report(), "spin of 'greedy'", &rt::SetupNote::subject), 1);
}

// Tested here because an exception allocates, which the guards of the tap's own tests forbid.
TEST(Server, TapsAMethodThatThrows) {
  EchoServer server;
  Node node(quiet_node());
  Binding binding = bind_echo(node, server);
  const auto tap = server.server->tap();
  ASSERT_TRUE(tap->switch_on({}));
  EXPECT_FALSE(binding.call(echo::kFail, bytes_of("throw")));
  const auto call = tap->next();
  ASSERT_TRUE(call);
  EXPECT_EQ(call->status, wire::Status::kServantFailed);
  EXPECT_EQ(call->request.size(), 5U);
  EXPECT_EQ(call->reply_size, refusal_text().size());
}

TEST(Server, LogsAMethodThatThrew) {
  const rtpm::test::ChildResult child = rtpm::test::run_in_child([]() -> std::string {
    EchoServer server;
    Node node(quiet_node());
    Binding binding = bind_echo(node, server);
    return binding.call(echo::kFail, bytes_of("throw")) ? "answered" : "failed";
  });
  EXPECT_EQ(child.said, "failed");
  expect_text(child.errors, {"echo: method fail failed: it threw"});
}

TEST(Server, LogsTheReasonOfARefusal) {
  const rtpm::test::ChildResult child = rtpm::test::run_in_child([]() -> std::string {
    EchoServer server;
    Node node(quiet_node());
    Binding binding = bind_echo(node, server);
    const std::string request = static_cast<char>(Refusal::kBadRequest) + std::string("x is 3\n");
    for (int i = 0; i < 1000; ++i)
      static_cast<void>(binding.call(echo::kRefuse, bytes_of(request)));
    const bool are_counted =
        rtpm::test::await([&] { return server.server->counters().bad_request_count == 1000; });
    return are_counted ? "counted" : "not counted";
  });
  EXPECT_EQ(child.said, "counted");
  expect_text(child.errors, {"echo: method refuse refused a request of 127.0.0.1: x is 3\\n"});
  EXPECT_LT(std::ranges::count(child.errors, '\n'), 100) << "some of them";
}

TEST(ServerWithoutTheRight, ServesTimeSharedWhenRealTimeIsPreferred) {
  const rtpm::test::ChildResult child = rtpm::test::run_in_child([]() -> std::string {
    rtpm::test::drop_realtime_rights();
    ServerConfig config = quiet_config();
    config.realtime = rt::RealtimeMode::kPrefer;
    EchoServer server(config);
    Node node(quiet_node());
    Binding binding = bind_echo(node, server);
    return binding.call(echo::kEcho, {}) ? "served" : "not served";
  });
  EXPECT_EQ(child.said, "served");
  expect_text(child.errors, {"warning", "Remedy"});
}

}  // namespace
}  // namespace rtpm::rpc
