#include <gtest/gtest.h>
#include <sched.h>
#include <sys/utsname.h>

#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <system_error>

#include "../system/programs.hpp"
#include "guest.hpp"
#include "rtpm/base/histogram.hpp"
#include "rtpm/gvd/client.hpp"
#include "rtpm/names/resolver.hpp"
#include "rtpm/rpc/node.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/thread.hpp"

/// The shipped programs with SCHED_FIFO on a PREEMPT_RT kernel.
namespace rtpm::vm_test {
namespace {

using namespace std::chrono_literals;
using system_test::start_daemon;

[[nodiscard]] bool is_preempt_rt() {
  utsname system{};
  return ::uname(&system) == 0 &&
         std::string(system.version).find("PREEMPT_RT") != std::string::npos;
}

/// The scheduling policies of all threads of the program, by the threads' names.
std::map<std::string, int> policies_of(const std::string& program) {
  std::map<std::string, int> policies;
  std::error_code gone;
  for (const auto& process : std::filesystem::directory_iterator("/proc", gone)) {
    std::string name;
    if (!std::getline(std::ifstream(process.path() / "comm"), name) || name != program) continue;
    for (const auto& task : std::filesystem::directory_iterator(process.path() / "task", gone)) {
      if (!std::getline(std::ifstream(task.path() / "comm"), name)) continue;
      policies[name] = ::sched_getscheduler(std::stoi(task.path().filename()));
    }
  }
  return policies;
}

long long microseconds(Duration time) {
  return std::chrono::duration_cast<std::chrono::microseconds>(time).count();
}

/// A registry and a device server with the simulated arm, neither of which starts without the right
/// to real-time scheduling and locked memory.
class Daemons : public testing::Test {
 protected:
  void SetUp() override {
    if (!is_preempt_rt()) {
      GTEST_SKIP() << "this kernel is not PREEMPT_RT; ./dev test-vm runs this test in a guest";
    }
    registry_ = start_daemon("rtpm-registryd", {"--port", "0", "--realtime", "require"});
    ASSERT_TRUE(registry_);
    device_ = start_daemon("rtpm-deviced",
                           {"--port", "0", "--registry", registry_->url, "--realtime", "require"});
    ASSERT_TRUE(device_);
    resolver_.emplace(node_, registry_->url);
    node_.use(*resolver_);
  }

  rpc::Node node_{{.wait = {.strategy = rt::WaitStrategy::kBlock}}};
  std::optional<system_test::Daemon> registry_{};
  std::optional<system_test::Daemon> device_{};
  std::optional<names::RegistryResolver> resolver_{};
};

TEST_F(Daemons, AreReadByTheToolAndRunTheDevicesThreadAtSchedFifo) {
  const auto read = system_test::run_program(
      "rtpm", {"call", "lab/arm0", "read", "--registry", registry_->url, "--deadline", "10s"});
  EXPECT_EQ(read.exit_code, 0) << read.errors;
  EXPECT_NE(read.output.find("\"position_m\""), std::string::npos) << read.output;
  const auto policies = policies_of("rtpm-deviced");
  ASSERT_TRUE(policies.contains("dev-arm0"));
  EXPECT_EQ(policies.at("dev-arm0"), SCHED_FIFO);
  EXPECT_EQ(policies.at("lane-haptic"), SCHED_FIFO);
  device_->process.send_signal(SIGTERM);
  const auto end = device_->process.wait(kPatience);
  ASSERT_TRUE(end);
  EXPECT_EQ(end->exit_code, 0) << end->errors;
}

TEST_F(Daemons, ApplyAForceWhileItIsCommandedAndTakeItAwayThen) {
  auto arm =
      gvd::DeviceClient::open(node_, "lab/arm0", {.bind = {.deadline = kPatience}, .hold = 100ms});
  ASSERT_TRUE(arm) << arm.error().text();
  ASSERT_TRUE(arm->acquire(kPatience));
  ASSERT_TRUE(arm->activate());
  const rpc::CallOptions patient{.deadline = 1s};
  const auto force = [&] {
    const auto sample = arm->read(patient);
    return sample ? std::abs(sample->wrench_applied.force_newton.x) : -1.0;
  };
  EXPECT_TRUE(await([&] {
    static_cast<void>(arm->set_force({1, 0, 0}, patient));
    return force() > 0.5;
  }));
  EXPECT_TRUE(await([&] { return force() == 0; }));
}

TEST_F(Daemons, RunCyclesWhoseNumberAndLatenessAreNoted) {
  auto arm = gvd::DeviceClient::open(node_, "lab/arm0", {.bind = {.deadline = kPatience}});
  ASSERT_TRUE(arm) << arm.error().text();
  const auto first = arm->read({.deadline = 1s});
  ASSERT_TRUE(first);
  // Measures the wake-up latency of a thread of the device's priority in this process.
  constexpr int kCycles = 1000;
  const auto lateness = std::make_unique<LatencyHistogram>();
  auto thread = rt::Thread::start(
      {.name = "lateness", .priority = Priority{30000}, .realtime = rt::RealtimeMode::kRequire},
      [&] {
        MonotonicTime due = rt::now();
        for (int i = 0; i < kCycles; ++i) {
          due += 1ms;
          rt::sleep_until(due);
          lateness->record(rt::now() - due);
        }
      });
  ASSERT_TRUE(thread) << thread.error().text();
  thread->join();
  const auto last = arm->read({.deadline = 1s});
  ASSERT_TRUE(last);
  EXPECT_EQ(lateness->count(), kCycles);
  EXPECT_GT(last->sequence, first->sequence);
  std::printf(
      "note: lab/arm0 ran %llu cycles in %lld ms; a thread of its priority woke late by %lld us "
      "(median), %lld us (99 %%), %lld us (most)\n",
      static_cast<unsigned long long>(last->sequence - first->sequence),
      microseconds(last->host_time - first->host_time) / 1000,
      microseconds(lateness->percentile(50)), microseconds(lateness->percentile(99)),
      microseconds(lateness->max()));
}

}  // namespace
}  // namespace rtpm::vm_test
