#include <gtest/gtest.h>

#include <array>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <vector>

#include "programs.hpp"

// Each peer that is built answers calls, and its results have the promised fields.
namespace rtpm::system_test {
namespace {

/// The results of the single peer of a run.
std::vector<nlohmann::json> lines_of_peer(const std::string& output, const std::string& peer) {
  std::vector<nlohmann::json> lines;
  std::istringstream stream(output);
  for (std::string line; std::getline(stream, line);) {
    auto result = nlohmann::json::parse(line);
    if (result.value("peer", "") == peer) lines.push_back(std::move(result));
  }
  return lines;
}

class CallingPeer : public testing::TestWithParam<std::string> {};

TEST_P(CallingPeer, AnswersCallsOfBothPriorities) {
  const std::string& peer = GetParam();
  if (!std::filesystem::exists(path_of("rtpm-peer-" + peer)))
    GTEST_SKIP() << peer << " is not built";
  const auto end =
      run_program("rtpm-bench", {"run", "call", "paced", "isolation", "--peers", peer, "--samples",
                                 "40", "--rounds", "2", "--low-callers", "0,2", "--transport",
                                 "udp,shm", "--realtime", "off", "--json"});
  EXPECT_EQ(end.exit_code, 0) << end.errors;
  const auto lines = lines_of_peer(end.output, GetParam());
  EXPECT_GE(lines.size(), 4U) << "one of call, one of paced, two of isolation: " << end.errors;
  for (const auto& line : lines) {
    EXPECT_EQ(line.at("n"), 40) << line;
    EXPECT_GT(line.at("p50_us"), 0) << line;
    EXPECT_GT(line.at("rtpm_p50_us"), 0) << line;
    EXPECT_GT(line.at("rtpm_over_peer_p999_high"), 0) << line;
  }
}

INSTANTIATE_TEST_SUITE_P(Peers, CallingPeer,
                         testing::Values("omniorb", "ice", "grpc", "capnproto", "zeromq", "nng",
                                         "cyclonedds", "fastdds", "lcm"),
                         [](const auto& peer) { return peer.param; });

class EventPeer : public testing::TestWithParam<std::string> {};

TEST_P(EventPeer, BringsEventsToEveryConsumer) {
  const std::string& peer = GetParam();
  if (!std::filesystem::exists(path_of("rtpm-peer-" + peer))) {
    GTEST_SKIP() << peer << " is not built";
  }
  const auto end = run_program(
      "rtpm-bench", {"run", "events", "--peers", peer, "--samples", "200", "--rounds", "1",
                     "--consumers", "3", "--transport", "udp,shm", "--realtime", "off", "--json"});
  EXPECT_EQ(end.exit_code, 0) << end.errors;
  const auto lines = lines_of_peer(end.output, peer);
  EXPECT_GE(lines.size(), 1U) << end.errors;
  for (const auto& line : lines) {
    EXPECT_EQ(line.at("n"), 200) << line;
    // Not all of these results are guaranteed, and the machine may be busy.
    EXPECT_LE(line.at("missing"), 60) << line;
    EXPECT_GE(line.at("last_p50_us"), line.at("each_p50_us")) << line;
    EXPECT_GT(line.at("rtpm_over_peer_last_p999"), 0) << line;
  }
}

INSTANTIATE_TEST_SUITE_P(Peers, EventPeer,
                         testing::Values("lcm", "omnievents", "zeromq", "nng", "mosquitto", "nats"),
                         [](const auto& peer) { return peer.param; });

}  // namespace
}  // namespace rtpm::system_test
