#include "rtpm/options/server_options.hpp"

#include <gtest/gtest.h>

#include "fixture.hpp"
#include "rtpm/test/text.hpp"
#include "rtpm/transport/shared_memory.hpp"

namespace rtpm::options {
namespace {

using namespace std::chrono_literals;

/// A program with two lanes, like rtpm-deviced, that also calls.
class ServerOptions : public Program {
 protected:
  ServerOptions() {
    settings_.server.port = 4711;
    settings_.server.lanes = {
        {.name = "lane-rest", .wait = {.strategy = rt::WaitStrategy::kBlock}},
        {.name = "lane-haptic", .low = 16384, .wait = {.strategy = rt::WaitStrategy::kPeriodic}}};
  }
  void add(Options& options) override {
    add_server(options, settings_);
    add_caller(options, settings_);
  }
  const rpc::LaneConfig& lane(std::size_t index) { return settings_.server.lanes.at(index); }

  ServerSettings settings_;
};

TEST_F(ServerOptions, KeepDefaultsThatAreNotConfigured) {
  expect_parsed({});
  EXPECT_EQ(settings_.server.port, 4711);
  ASSERT_EQ(settings_.server.lanes.size(), 2u);
  EXPECT_EQ(lane(0).name, "lane-rest");
  EXPECT_EQ(lane(1).low, 16384);
  EXPECT_EQ(lane(1).wait.strategy, rt::WaitStrategy::kPeriodic);
  EXPECT_FALSE(settings_.cpu_latency);
}

TEST_F(ServerOptions, SetSecurityAlsoOfTheProgramsNode) {
  set_variable("RTPM_KNOWN_SERVERS", "servers");
  expect_parsed(words("--authorized grants --key key --insecure --audit audit --key-log keys"));
  const rpc::ServerSecurity& security = settings_.server.security;
  EXPECT_EQ(security.authorized_file, "grants");
  EXPECT_EQ(security.key_file, "key");
  EXPECT_TRUE(security.is_insecure);
  EXPECT_EQ(security.audit_file, "audit");
  EXPECT_EQ(security.key_log_file, "keys");
  EXPECT_EQ(node_security(settings_).key_file, "key");
  EXPECT_EQ(node_security(settings_).key_log_file, "keys");
  EXPECT_EQ(node_security(settings_).known_servers_file, "servers");
}

TEST_F(ServerOptions, SetEveryPartOfALane) {
  expect_parsed({"--config", file_with("[lane.haptic]\n"
                                       "low = 20000\n"
                                       "priority = 21000\n"
                                       "cpus = [0, 1]\n"
                                       "wait = 'spin'\n"
                                       "spin = '70us'\n"
                                       "schedule = 'time-shared'\n"
                                       "threads = 3\n"
                                       "dynamic-threads = 4\n"
                                       "dynamic-idle = '2s'\n"
                                       "buffered-requests = 5\n"
                                       "buffered-bytes = 6000\n")});
  EXPECT_EQ(lane(1).low, 20000);
  EXPECT_EQ(lane(1).priority, 21000);
  EXPECT_EQ(lane(1).cpus, (std::vector<int>{0, 1}));
  EXPECT_EQ(lane(1).wait.strategy, rt::WaitStrategy::kSpin);
  EXPECT_EQ(lane(1).wait.spin, 70us);
  EXPECT_EQ(lane(1).schedule, rt::Schedule::kTimeShared);
  EXPECT_EQ(lane(1).static_threads, 3u);
  EXPECT_EQ(lane(1).dynamic_threads, 4u);
  EXPECT_EQ(lane(1).dynamic_idle, 2s);
  EXPECT_EQ(lane(1).buffered_request_max, 5u);
  EXPECT_EQ(lane(1).buffered_byte_max, 6000u);
  EXPECT_EQ(lane(0).static_threads, 1u) << "the other lane stays as it was";
}

TEST_F(ServerOptions, SetTheServer) {
  expect_parsed(
      words("--host 10.0.0.7 --port 9 --shared-memory=false --shared-memory-folder /run/lab "
            "--realtime require --cpu-latency 20us --ceiling 30000 --borrows --sessions-max 7 "
            "--message-size-max 65536 --large-messages-max 2 --deferred-calls-max 3 "
            "--streams-max 4 --stream-bytes-max 65536 --local-oneways-max 100 --setup-report"));
  const rpc::ServerConfig& server = settings_.server;
  EXPECT_EQ(server.host, "10.0.0.7");
  EXPECT_EQ(server.port, 9);
  EXPECT_FALSE(server.shared_memory);
  EXPECT_EQ(server.shared_memory_folder, "/run/lab");
  EXPECT_EQ(server.realtime, rt::RealtimeMode::kRequire);
  EXPECT_EQ(settings_.cpu_latency, 20us);
  EXPECT_EQ(server.ceiling, 30000);
  EXPECT_TRUE(server.borrows);
  EXPECT_EQ(server.session_count_max, 7u);
  EXPECT_EQ(server.message_size_max, 65536u);
  EXPECT_EQ(server.large_message_count_max, 2u);
  EXPECT_EQ(server.deferred_call_count_max, 3u);
  EXPECT_EQ(server.stream_count_max, 4u);
  EXPECT_EQ(server.stream_byte_max, 65536u);
  EXPECT_EQ(server.local_oneway_count_max, 100u);
  EXPECT_TRUE(settings_.shows_setup);
}

TEST_F(ServerOptions, AddLanesOfTheUser) {
  expect_parsed(words("--lanes rest,camera,haptic --lane-camera-low 5000"));
  ASSERT_EQ(settings_.server.lanes.size(), 3u);
  EXPECT_EQ(lane(1).name, "lane-camera");
  EXPECT_EQ(lane(1).low, 5000);
  EXPECT_EQ(lane(2).wait.strategy, rt::WaitStrategy::kPeriodic) << "defaults stay with their lane";
  expect_parsed({"--lanes", "rest"});
  EXPECT_EQ(settings_.server.lanes.size(), 1u);
}

TEST_F(ServerOptions, TakeLanesFromFileEnvironmentAndFlagsByRank) {
  const std::string file =
      file_with("lanes = ['one', 'two']\n[lane.two]\nlow = 100\n[lane.one]\nthreads = 2\n");
  expect_parsed({"--config", file, "--lane-two-threads", "3"});
  ASSERT_EQ(settings_.server.lanes.size(), 2u);
  EXPECT_EQ(lane(0).name, "lane-one");
  EXPECT_EQ(lane(0).static_threads, 2u);
  EXPECT_EQ(lane(1).low, 100);
  EXPECT_EQ(lane(1).static_threads, 3u);
  set_variable("RTPM_LANES", "one,two,three");
  set_variable("RTPM_LANE_THREE_LOW", "300");
  set_variable("RTPM_CONFIG", file);
  expect_parsed({});
  ASSERT_EQ(settings_.server.lanes.size(), 3u);
  EXPECT_EQ(lane(2).low, 300);
  expect_parsed({"--lanes=two", "--lanes", "one"});
  EXPECT_EQ(settings_.lanes, (std::vector<std::string>{"two", "one"}));
}

TEST_F(ServerOptions, RoundTripThroughTheDump) {
  expect_output(
      words("--lanes rest,camera --lane-camera-low 5000 --lane-camera-cpus 1 --cpu-latency 5us "
            "--lane-rest-schedule time-shared --borrows --dump-config"),
      {"[lane.camera]\n"});
  const std::string file = file_with(out_);
  settings_ = {};
  expect_parsed({"--config", file});
  ASSERT_EQ(settings_.server.lanes.size(), 2u);
  EXPECT_EQ(lane(1).low, 5000);
  EXPECT_EQ(lane(1).cpus, std::vector<int>{1});
  EXPECT_EQ(lane(0).schedule, rt::Schedule::kTimeShared);
  EXPECT_EQ(settings_.cpu_latency, 5us);
  EXPECT_TRUE(settings_.server.borrows);
}

TEST_F(ServerOptions, NameMistakes) {
  expect_error({"--lane-haptik-low", "5"}, {"did you mean '--lane-haptic-low'?"});
  expect_file_error("lane.haptic.lwo = 5\n", {"did you mean 'lane.haptic.low'?"});
  expect_file_error("lanes = ['rest']\nlane.haptic.low = 5\n", {"unknown key 'lane.haptic'"});
  expect_error({"--lanes", "muchtoolongs"}, {"of up to 10 bytes each"});
  expect_error({"--lane-rest-cpus", "1024"}, {"from 0 to 1023"});
  expect_error({"--lane-rest-cpus", "one"}, {"from 0 to 1023"});
  expect_error({"--lane-rest-threads", "65"}, {"from 1 to 64"});
  expect_error({"--lane-rest-schedule", "batch"}, {"is not one of fifo, time-shared"});
}

TEST_F(ServerOptions, ListTheLanesInTheHelp) {
  expect_output({"--help"}, {"--port"});
  EXPECT_EQ(out_.find("--lane-haptic-low"), out_.npos) << out_;
  expect_output({"--help-all"}, {"--lanes NAME,NAME", "[rest,haptic]", "--lane-haptic-low PRIORITY",
                                 "--cpu-latency off|TIME", "[off]"});
}

TEST_F(ServerOptions, RequestTheCpuLatencyOnlyIfConfigured) {
  expect_parsed({});
  const auto nothing = prepare(settings_);
  ASSERT_TRUE(nothing);
  EXPECT_FALSE(nothing->is_granted());
  settings_.cpu_latency = 10us;
  settings_.server.realtime = rt::RealtimeMode::kOff;
  const auto off = prepare(settings_);
  ASSERT_TRUE(off);
  EXPECT_FALSE(off->is_granted());
}

TEST_F(ServerOptions, RefuseSharedMemoryThatTheSystemDoesNotOffer) {
  if (transport::offers_shared_memory()) GTEST_SKIP() << "this system offers shared memory";
  expect_parsed(words("--shared-memory"));
  const auto refused = prepare(settings_);
  ASSERT_FALSE(refused);
  rtpm::test::expect_text(refused.error().text(),
                          {"--shared-memory", "this system offers no", "Remedy", "UDP or TCP"});
  expect_parsed(words("--shared-memory=false"));
  EXPECT_TRUE(prepare(settings_));
}

}  // namespace
}  // namespace rtpm::options
