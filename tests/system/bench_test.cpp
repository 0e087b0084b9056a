#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "programs.hpp"

// rtpm-bench runs and reports what it promises; its figures are not judged here.
namespace rtpm::system_test {
namespace {

TEST(Bench, ListsItsCases) {
  const auto end = run_program("rtpm-bench", {"list"});
  EXPECT_EQ(end.exit_code, 0);
  for (const std::string_view name : {"call", "paced", "isolation", "events", "two-node"}) {
    EXPECT_NE(("\n" + end.output).find("\n" + std::string(name)), std::string::npos) << name;
  }
}

TEST(Bench, RefusesUnknownCases) {
  using Words = std::vector<std::string>;
  for (const auto& [arguments, words] : std::vector<std::pair<Words, Words>>{
           {{"run", "nothing"}, {"nothing", "call", "isolation"}},
           {{"run"}, {"CASE is required"}},
           {{"walk"}, {"walk"}},
           {{"run", "call", "--wait", "sleep"}, {"--wait", "sleep", "adaptive"}},
           {{"run", "call", "--payload", "1Gi"}, {"--payload", "8388608"}},
           {{"run", "call", "--own-hub"}, {"--own-hub", "events", "--peers"}},
           {{"run", "events", "--own-hub", "--peers", "zeromq"}, {"--own-hub", "broker", "zeromq"}},
           {{"run", "events", "--multicast"}, {"--multicast", "events", "--transport udp"}},
           {{"run", "call", "--sealed"}, {"--sealed", "--transport udp"}},
           {{"run", "paced", "--sealed", "--transport", "udp"}, {"--sealed", "isolation"}},
           {{"run", "call", "--peers", "pigeons"}, {"--peers", "pigeons", "zeromq", "omniorb"}}}) {
    const auto end = run_program("rtpm-bench", arguments);
    expect_one_sentence(end, 2, {words.begin(), words.end()});
  }
}

TEST(Bench, PrintsAnObjectPerResultWithItsFields) {
  const auto end = run_program("rtpm-bench", {"run", "call", "--samples", "200", "--rounds", "2",
                                              "--realtime", "off", "--json"});
  EXPECT_EQ(end.exit_code, 0) << end.errors;
  EXPECT_EQ(test::line_count(end.output), 3) << "one for udp, one for tcp, one for shm";
  expect_text(end.output,
              {R"("case":"call")", R"("transport":"udp")", R"("transport":"tcp")",
               R"("transport":"shm")", R"("wait":"adaptive")", R"("payload":48)", R"("n":200)",
               R"("p50_us":)", R"("p90_us":)", R"("p99_us":)", R"("p999_us":)", R"("p9999_us":)",
               R"("max_us":)", R"("floor_p50_us":)", R"("ratio_p50":)", R"("environment":{)"});
}

TEST(Bench, SealsTheSessionsOfBothSides) {
  const auto calls =
      run_program("rtpm-bench", {"run", "call", "--sealed", "--transport", "udp,tcp", "--samples",
                                 "100", "--rounds", "2", "--realtime", "off", "--json"});
  EXPECT_EQ(calls.exit_code, 0) << calls.errors;
  EXPECT_EQ(test::line_count(calls.output), 2);
  EXPECT_NE(calls.output.find(R"("case":"call-sealed")"), std::string::npos);
  const auto storm =
      run_program("rtpm-bench", {"run", "isolation", "--sealed", "--transport", "udp", "--samples",
                                 "200", "--realtime", "off", "--json"});
  EXPECT_EQ(storm.exit_code, 0) << storm.errors;
  expect_text(storm.output, {R"("case":"isolation-sealed")", R"("hello_storms":1)",
                             R"("loaded_over_idle_p50":)"});
}

TEST(Bench, CarriesPayloadsOfEverySize) {
  const auto end =
      run_program("rtpm-bench", {"run", "call", "--payload", "0,1Ki,64Ki,1Mi", "--samples", "10",
                                 "--rounds", "2", "--realtime", "off", "--json"});
  EXPECT_EQ(end.exit_code, 0) << end.errors;
  EXPECT_EQ(test::line_count(end.output), 12) << "four payloads over udp, tcp and shm";
  expect_text(end.output, {R"("payload":0,)", R"("payload":1024,)", R"("payload":65536,)",
                           R"("payload":1048576,)"});
}

TEST(Bench, PrintsEveryLatencyOnRequest) {
  const auto end =
      run_program("rtpm-bench", {"run", "call", "--samples", "4", "--rounds", "2", "--transport",
                                 "udp", "--realtime", "off", "--json", "--latencies"});
  EXPECT_EQ(end.exit_code, 0) << end.errors;
  for (const std::string_view name : {"latencies_us", "floor_latencies_us"}) {
    const std::size_t at = end.output.find("\"" + std::string(name) + "\":[");
    ASSERT_NE(at, std::string::npos) << name;
    const std::string list = end.output.substr(at, end.output.find(']', at) - at);
    EXPECT_EQ(std::count(list.begin(), list.end(), ','), 3) << list;
  }
}

TEST(Bench, ComparesTheLoadedServerWithTheIdleOne) {
  const auto end = run_program(
      "rtpm-bench", {"run", "isolation", "--samples", "40", "--rounds", "2", "--low-callers", "0,2",
                     "--transport", "udp", "--realtime", "off", "--json"});
  EXPECT_EQ(end.exit_code, 0) << end.errors;
  EXPECT_EQ(test::line_count(end.output), 2) << "one idle, one with two low-priority callers";
  expect_text(end.output, {R"("low_callers":0)", R"("low_callers":2)", R"("ratio_p999":)",
                           R"("loaded_over_idle_p99":)", R"("floor_loaded_over_idle_p99":)",
                           R"("low_p50_us":)"});
}

// A program without RTPM has two sockets and two threads, whatever transport RTPM uses.
TEST(Bench, IsolatesOverSharedMemoryBesideSocketsAndBesideRings) {
  const auto end = run_program(
      "rtpm-bench", {"run", "isolation", "--samples", "40", "--rounds", "2", "--low-callers", "2",
                     "--transport", "shm", "--realtime", "off", "--json"});
  EXPECT_EQ(end.exit_code, 0) << end.errors;
  EXPECT_EQ(test::line_count(end.output), 2) << end.output;
  constexpr std::string_view kBesideSockets = R"("floor":"udp")";
  EXPECT_NE(end.output.find(kBesideSockets), std::string::npos) << end.output;
  EXPECT_EQ(end.output.find(kBesideSockets), end.output.rfind(kBesideSockets)) << end.output;
}

TEST(Bench, ClosesALoopThroughADevice) {
  const auto end = run_program("rtpm-bench", {"run", "device", "--samples", "40", "--rounds", "2",
                                              "--transport", "udp", "--realtime", "off", "--json"});
  EXPECT_EQ(end.exit_code, 0) << end.errors;
  expect_text(end.output, {R"("case":"device")", R"("ratio_p50":)"});
}

TEST(Bench, ServesManyClients) {
  const auto end =
      run_program("rtpm-bench", {"run", "scale", "memory", "--clients", "20", "--samples", "40",
                                 "--rounds", "2", "--realtime", "off", "--json"});
  EXPECT_EQ(end.exit_code, 0) << end.errors;
  EXPECT_EQ(test::line_count(end.output), 12)
      << "scale over three transports, memory three of each";
  expect_text(end.output,
              {R"("clients":20)", R"("clients":100)", R"("per_client_kib":)", R"("rss_mib":)"});
}

TEST(Bench, StartsServersOfTheirOwn) {
  const auto end = run_program("rtpm-bench", {"run", "startup", "--transport", "udp", "--samples",
                                              "2", "--rounds", "1", "--realtime", "off", "--json"});
  EXPECT_EQ(end.exit_code, 0) << end.errors;
  expect_text(end.output, {R"("ready_p50_us":)", R"("bind_p50_us":)", R"("floor_ready_p50_us":)"});
  expect_one_sentence(run_program("rtpm-bench", {"serve", "nothing"}), 2, {"rtpm", "floor"});
}

TEST(Bench, RefusesToSpinWhereThatStarvesTheLoad) {
  const auto end = run_program("rtpm-bench", {"run", "isolation", "--wait", "spin", "--transport",
                                              "udp", "--realtime", "off"});
  expect_one_sentence(end, 1, {"isolation, udp, spin", "starve", "--wait adaptive"});
}

TEST(Bench, NamesThePackageOfAPeerThatIsNotBuilt) {
  if (std::filesystem::exists(path_of("rtpm-peer-zeromq"))) GTEST_SKIP() << "the peers are built";
  expect_one_sentence(run_program("rtpm-bench", {"run", "call", "--peers", "zeromq"}), 1,
                      {"peer zeromq", "not built", "apt-get install libzmq3-dev"});
  const auto all = run_program("rtpm-bench", {"run", "call", "--peers", "all"});
  EXPECT_EQ(all.exit_code, 0) << "who asks for all takes what there is";
  EXPECT_NE(all.errors.find("peer omniorb"), std::string::npos) << all.errors;
}

}  // namespace
}  // namespace rtpm::system_test
