#include <gtest/gtest.h>

#include "rtpm/rt/clock.hpp"
#include "rtpm/test/echo_server.hpp"
#include "rtpm/test/os.hpp"

namespace rtpm::rpc {
namespace {

using namespace std::chrono_literals;
using namespace test;

// A lane keeps the promise of rt::SpinEstimator.
TEST(AdaptiveLane, SpinsInVainForNoCallerThatAlwaysComesLater) {
  LaneConfig lane;
  lane.wait = {.strategy = rt::WaitStrategy::kAdaptive, .spin = 5ms};
  EchoServer server(quiet_config({lane}));
  NodeConfig config = quiet_node(Transport::kUdp);
  config.collocates = false;
  config.wait.strategy = rt::WaitStrategy::kBlock;
  Node node(config);
  Binding binding = bind_echo(node, server);
  const auto call = [&](int count) {
    for (int i = 0; i < count; ++i) {
      ASSERT_TRUE(binding.call(echo::kEcho, {}));
      rt::sleep_until(rt::now() + 8ms);
    }
  };
  call(20);
  const Duration before = rtpm::test::process_cpu_time();
  call(30);
  EXPECT_LT(rtpm::test::process_cpu_time() - before, 60ms) << "it would spin for 150 ms otherwise";
}

}  // namespace
}  // namespace rtpm::rpc
