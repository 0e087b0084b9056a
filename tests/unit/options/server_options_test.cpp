#include "rtpm/options/server_options.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "rtpm/rt/report.hpp"

namespace rtpm::options {
namespace {

using namespace std::chrono_literals;

/// A program with two lanes, like rtpm-deviced.
class ServerOptions : public testing::Test {
 protected:
  ServerOptions() {
    settings_.server.port = 4711;
    settings_.server.lanes = {
        {.name = "lane-rest", .wait = {.strategy = rt::WaitStrategy::kBlock}},
        {.name = "lane-haptic", .low = 16384, .wait = {.strategy = rt::WaitStrategy::kPeriodic}}};
  }
  void TearDown() override {
    for (const auto& [name, value] : environment_)
      unsetenv(name.c_str());
    if (!path_.empty()) std::filesystem::remove(path_);
  }
  void set_variable(const std::string& name, const std::string& value) {
    environment_[name] = value;
    setenv(name.c_str(), value.c_str(), 1);
  }
  std::string file_with(const std::string& text) {
    path_ = testing::TempDir() + "server_options_test_" + std::to_string(getpid());
    std::ofstream(path_) << text;
    return path_;
  }
  std::optional<int> parse(const std::vector<std::string>& arguments) {
    return parse_into(settings_, arguments);
  }
  std::optional<int> parse_into(ServerSettings& settings,
                                const std::vector<std::string>& arguments) {
    Options options("rtpm-test", "tries options");
    add_server(options, settings);
    std::vector<const char*> argv{"rtpm-test"};
    for (const std::string& argument : arguments)
      argv.push_back(argument.c_str());
    testing::internal::CaptureStdout();
    testing::internal::CaptureStderr();
    const auto exit_code = options.parse(static_cast<int>(argv.size()), argv.data());
    out_ = testing::internal::GetCapturedStdout();
    err_ = testing::internal::GetCapturedStderr();
    return exit_code;
  }
  void expect_error(const std::vector<std::string>& arguments, const std::string& words) {
    EXPECT_EQ(parse(arguments), 2);
    EXPECT_NE(err_.find(words), err_.npos) << "'" << words << "' is not in: " << err_;
  }
  const rpc::LaneConfig& lane(std::size_t index) { return settings_.server.lanes.at(index); }

  ServerSettings settings_;
  std::string out_;
  std::string err_;

 private:
  std::map<std::string, std::string> environment_;
  std::string path_;
};

TEST_F(ServerOptions, KeepDefaultsThatAreNotConfigured) {
  EXPECT_FALSE(parse({}));
  EXPECT_EQ(settings_.server.port, 4711);
  ASSERT_EQ(settings_.server.lanes.size(), 2u);
  EXPECT_EQ(lane(0).name, "lane-rest");
  EXPECT_EQ(lane(1).low, 16384);
  EXPECT_EQ(lane(1).wait.strategy, rt::WaitStrategy::kPeriodic);
  EXPECT_FALSE(settings_.cpu_latency);
}

TEST_F(ServerOptions, SetSecurity) {
  EXPECT_FALSE(parse({"--authorized", "grants", "--key", "key", "--insecure", "--audit", "audit",
                      "--key-log", "keys"}))
      << err_;
  const rpc::ServerSecurity& security = settings_.server.security;
  EXPECT_EQ(security.authorized_file, "grants");
  EXPECT_EQ(security.key_file, "key");
  EXPECT_TRUE(security.is_insecure);
  EXPECT_EQ(security.audit_file, "audit");
  EXPECT_EQ(security.key_log_file, "keys");
}

TEST_F(ServerOptions, GiveTheProgramsNodeTheSameKey) {
  set_variable("RTPM_KEY", "key");
  set_variable("RTPM_KNOWN_SERVERS", "servers");
  Options options("rtpm-test", "tries options");
  add_server(options, settings_);
  add_caller(options, settings_);
  const char* const name = "rtpm-test";
  ASSERT_FALSE(options.parse(1, &name));
  EXPECT_EQ(settings_.server.security.key_file, "key");
  EXPECT_EQ(node_security(settings_).key_file, "key");
  EXPECT_EQ(node_security(settings_).known_servers_file, "servers");
}

TEST_F(ServerOptions, SetEveryPartOfALane) {
  EXPECT_FALSE(parse({"--lane-haptic-low",
                      "20000",
                      "--lane-haptic-priority",
                      "21000",
                      "--lane-haptic-cpus",
                      "0,1",
                      "--lane-haptic-wait",
                      "spin",
                      "--lane-haptic-spin",
                      "70us",
                      "--lane-haptic-schedule",
                      "time-shared",
                      "--lane-haptic-threads",
                      "3",
                      "--lane-haptic-dynamic-threads",
                      "4",
                      "--lane-haptic-dynamic-idle",
                      "2s",
                      "--lane-haptic-buffered-requests",
                      "5",
                      "--lane-haptic-buffered-bytes",
                      "6000"}))
      << err_;
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
  EXPECT_FALSE(parse({"--host",
                      "10.0.0.7",
                      "--port",
                      "9",
                      "--shared-memory=false",
                      "--shared-memory-folder",
                      "/run/lab",
                      "--realtime",
                      "require",
                      "--cpu-latency",
                      "20us",
                      "--ceiling",
                      "30000",
                      "--borrows",
                      "--sessions-max",
                      "7",
                      "--message-size-max",
                      "65536",
                      "--large-messages-max",
                      "2",
                      "--deferred-calls-max",
                      "3",
                      "--streams-max",
                      "4",
                      "--stream-bytes-max",
                      "65536",
                      "--local-oneways-max",
                      "100",
                      "--setup-report"}))
      << err_;
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
  EXPECT_FALSE(parse({"--lanes", "rest,camera,haptic", "--lane-camera-low", "5000"})) << err_;
  ASSERT_EQ(settings_.server.lanes.size(), 3u);
  EXPECT_EQ(lane(1).name, "lane-camera");
  EXPECT_EQ(lane(1).low, 5000);
  EXPECT_EQ(lane(2).wait.strategy, rt::WaitStrategy::kPeriodic) << "defaults stay with their lane";
  EXPECT_FALSE(parse({"--lanes", "rest"}));
  EXPECT_EQ(settings_.server.lanes.size(), 1u);
}

TEST_F(ServerOptions, TakeLanesFromFileEnvironmentAndFlagsByRank) {
  const std::string file =
      file_with("lanes = ['one', 'two']\n[lane.two]\nlow = 100\n[lane.one]\nthreads = 2\n");
  EXPECT_FALSE(parse({"--config", file, "--lane-two-threads", "3"})) << err_;
  ASSERT_EQ(settings_.server.lanes.size(), 2u);
  EXPECT_EQ(lane(0).name, "lane-one");
  EXPECT_EQ(lane(0).static_threads, 2u);
  EXPECT_EQ(lane(1).low, 100);
  EXPECT_EQ(lane(1).static_threads, 3u);
  set_variable("RTPM_LANES", "one,two,three");
  set_variable("RTPM_LANE_THREE_LOW", "300");
  set_variable("RTPM_CONFIG", file);
  EXPECT_FALSE(parse({})) << err_;
  ASSERT_EQ(settings_.server.lanes.size(), 3u);
  EXPECT_EQ(lane(2).low, 300);
  EXPECT_FALSE(parse({"--lanes=two", "--lanes", "one"})) << err_;
  EXPECT_EQ(settings_.lanes, (std::vector<std::string>{"two", "one"}));
}

TEST_F(ServerOptions, RoundTripThroughTheDump) {
  const std::vector<std::string> flags{"--lanes",
                                       "rest,camera",
                                       "--lane-camera-low",
                                       "5000",
                                       "--lane-camera-cpus",
                                       "1",
                                       "--cpu-latency",
                                       "5us",
                                       "--lane-rest-wait",
                                       "spin",
                                       "--streams-max",
                                       "3",
                                       "--borrows",
                                       "--lane-rest-schedule",
                                       "time-shared"};
  std::vector<std::string> with_dump = flags;
  with_dump.emplace_back("--dump-config");
  EXPECT_EQ(parse(with_dump), 0);
  const std::string dump = out_;
  ServerSettings again;
  again.server.lanes = {{.name = "lane-rest"}};
  const std::string file = file_with(dump);
  EXPECT_FALSE(parse_into(again, {"--config", file})) << err_;
  ASSERT_EQ(again.server.lanes.size(), 2u);
  EXPECT_EQ(again.server.lanes[1].low, 5000);
  EXPECT_EQ(again.server.lanes[1].cpus, std::vector<int>{1});
  EXPECT_EQ(again.server.lanes[0].wait.strategy, rt::WaitStrategy::kSpin);
  EXPECT_EQ(again.server.lanes[0].schedule, rt::Schedule::kTimeShared);
  EXPECT_EQ(again.cpu_latency, 5us);
  EXPECT_EQ(again.server.stream_count_max, 3u);
  EXPECT_TRUE(again.server.borrows);
  ServerSettings third;
  EXPECT_EQ(parse_into(third, {"--config", file, "--dump-config"}), 0);
  const auto without_sources = [](const std::string& text) {
    std::string values;
    for (std::size_t begin = 0; begin < text.size();) {
      const std::size_t end = text.find('\n', begin);
      if (text[begin] != '#') values += text.substr(begin, end - begin + 1);
      begin = end + 1;
    }
    return values;
  };
  EXPECT_EQ(without_sources(out_), without_sources(dump));
}

TEST_F(ServerOptions, NameMistakes) {
  expect_error({"--lane-haptik-low", "5"}, "did you mean '--lane-haptic-low'?");
  expect_error({"--config", file_with("lane.haptic.lwo = 5\n")}, "did you mean 'lane.haptic.low'?");
  expect_error({"--config", file_with("lanes = ['rest']\nlane.haptic.low = 5\n")},
               "unknown key 'lane.haptic'");
  expect_error({"--lanes", "rest,rest"}, "is not a list of different names");
  expect_error({"--lanes", "a-b,A_b"}, "is not a list of different names");
  expect_error({"--lanes", "a/b"}, "is not a list of different names");
  expect_error({"--lanes", "muchtoolongs"}, "of up to 10 bytes each");
  expect_error({"--lanes", ""}, "is not a list of different names");
  expect_error({"--lane-rest-cpus", "1024"}, "from 0 to 1023");
  expect_error({"--lane-rest-cpus", "one"}, "from 0 to 1023");
  expect_error({"--lane-rest-threads", "65"}, "from 1 to 64");
  expect_error({"--lane-rest-schedule", "batch"}, "is not fifo or time-shared");
  expect_error({"--cpu-latency", "5"}, "is not off, or a time with a unit");
}

TEST_F(ServerOptions, ListTheLanesInTheHelp) {
  EXPECT_EQ(parse({"--help"}), 0);
  EXPECT_EQ(out_.find("--lane-haptic-low"), out_.npos) << out_;
  EXPECT_EQ(parse({"--help-all"}), 0);
  for (const char* part : {"--lanes NAME,NAME", "[rest,haptic]", "--lane-haptic-low PRIORITY",
                           "--cpu-latency off|TIME", "[off]"}) {
    EXPECT_NE(out_.find(part), out_.npos) << part << " is not in\n" << out_;
  }
}

TEST_F(ServerOptions, RequestTheCpuLatencyOnlyIfConfigured) {
  const auto nothing = prepare(settings_);
  ASSERT_TRUE(nothing);
  EXPECT_FALSE(nothing->is_granted());
  settings_.cpu_latency = 10us;
  settings_.server.realtime = rt::RealtimeMode::kOff;
  const auto off = prepare(settings_);
  ASSERT_TRUE(off);
  EXPECT_FALSE(off->is_granted());
}

}  // namespace
}  // namespace rtpm::options
