#include <gtest/gtest.h>
#include <sched.h>
#include <signal.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <set>
#include <string>

#include "programs.hpp"

// The promises of rtpm-bench's cases over a network, on any machine: each call is answered, and
// nothing is left behind. How long it takes is not judged.
namespace rtpm::system_test {
namespace {

namespace fs = std::filesystem;

/// Why network namespaces can't be created here; empty if they can.
std::string missing_for_two_nodes() {
  if (std::system("command -v ip >/dev/null") != 0) return "the program 'ip' is missing";
  // Runs in a separate process, so that this process stays in its namespace.
  const auto end = test::run({"/usr/bin/unshare", "--net", "true"}, kPatience);
  if (!end || end->exit_code != 0) return "network namespaces take the right CAP_SYS_ADMIN";
  return {};
}

/// The network namespaces in which processes of rtpm-bench are, those of their threads included. A
/// namespace without a name ends with the last process in it.
std::set<std::string> network_namespaces() {
  std::set<std::string> names;
  std::error_code gone;
  for (const auto& process : fs::directory_iterator("/proc", gone)) {
    std::string command;
    std::getline(std::ifstream(process.path() / "comm"), command);
    if (command != "rtpm-bench") continue;
    for (const auto& thread : fs::directory_iterator(process.path() / "task", gone)) {
      const fs::path name = fs::read_symlink(thread.path() / "ns/net", gone);
      if (!gone) names.insert(name.string());
    }
  }
  return names;
}

class TwoNodeBench : public testing::Test {
 protected:
  void SetUp() override {
    const std::string missing = missing_for_two_nodes();
    if (!missing.empty()) GTEST_SKIP() << missing;
  }
};

TEST_F(TwoNodeBench, CallsBetweenTheHosts) {
  const auto end =
      run_program("rtpm-bench", {"run", "two-node", "--samples", "200", "--rounds", "2",
                                 "--realtime", "off", "--json", "--transport", "udp,tcp"});
  ASSERT_EQ(end.exit_code, 0) << end.errors;
  EXPECT_EQ(test::line_count(end.output), 2) << "one for udp, one for tcp";
  expect_text(end.output, {R"("case":"two-node")", R"("n":200)", R"("ratio_p50":)"});
}

TEST_F(TwoNodeBench, LeavesNoNamespaceBehindWhenInterrupted) {
  const std::set<std::string> before = network_namespaces();
  {
    test::Process bench({path_of("rtpm-bench"), "run", "two-node", "--samples", "10000000",
                         "--realtime", "off", "--transport", "udp"});
    const auto give_up = std::chrono::steady_clock::now() + kPatience;
    // Waits for the namespaces of rtpm-bench itself, the server and the caller.
    while (network_namespaces().size() < before.size() + 3 &&
           std::chrono::steady_clock::now() < give_up) {
      sched_yield();
    }
    ASSERT_EQ(network_namespaces().size(), before.size() + 3) << "the run does not begin";
    bench.send_signal(SIGINT);
    ASSERT_TRUE(bench.wait(kPatience));
  }
  // The kernel soon ends the servers of rtpm-bench.
  const auto give_up = std::chrono::steady_clock::now() + kPatience;
  while (network_namespaces() != before && std::chrono::steady_clock::now() < give_up)
    sched_yield();
  EXPECT_EQ(network_namespaces(), before);
}

TEST(TwoNodeBenchOptions, NamesCasesThatCannotRunBetweenHosts) {
  const auto end =
      run_program("rtpm-bench", {"run", "two-node", "--transport", "shm", "--realtime", "off"});
  expect_one_sentence(end, 1, {"two-node", "--transport udp"});
}

}  // namespace
}  // namespace rtpm::system_test
