#include <gtest/gtest.h>
#include <signal.h>

#include <atomic>
#include <string>
#include <vector>

#include "programs.hpp"
#include "rtpm/gvd/client.hpp"
#include "rtpm/gvd/poller.hpp"
#include "rtpm/names/directory.hpp"
#include "rtpm/names/resolver.hpp"
#include "rtpm/test/os.hpp"

// Names whose target changes after a while, and programs that request more names than their quota.
namespace rtpm::system_test {
namespace {

using namespace std::chrono_literals;

class CountingSink final : public gvd::SampleSink {
 public:
  void push(const driver::Sample&) override { ++count; }
  std::atomic<int> count{0};
};

class Names : public Laboratory {
 protected:
  void SetUp() override {
    Laboratory::SetUp();
    ASSERT_TRUE(registry_ && device_);
    resolver_.emplace(node_, registry_->url);
    node_.use(*resolver_);
    directory_.emplace(node_, registry_->url);
  }

  [[nodiscard]] std::string errors_at_the_end_of(Daemon& daemon) {
    daemon.process.send_signal(SIGTERM);
    const auto end = daemon.process.wait(kPatience);
    EXPECT_TRUE(end) << daemon.url << " did not end";
    return end ? end->errors : "";
  }
  void kill_device() {
    device_->process.send_signal(SIGKILL);
    ASSERT_TRUE(device_->process.wait(kPatience));
  }

  rpc::Node node_{{.wait = {.strategy = rt::WaitStrategy::kBlock}}};
  std::optional<names::RegistryResolver> resolver_{};
  std::optional<names::Directory> directory_{};
};

TEST_F(Names, LeadDisplaysAndClientsToADeviceThatCameBackAtAnotherPort) {
  auto arm = gvd::DeviceClient::open(node_, "lab/arm0", {.bind = {.deadline = kPatience}});
  ASSERT_TRUE(arm) << arm.error().text();
  ASSERT_TRUE(arm->acquire(kPatience));
  CountingSink sink;
  gvd::DevicePollerConfig config{.rate_hz = 100};
  config.thread.realtime = rt::RealtimeMode::kOff;
  const auto consumer = gvd::DevicePoller::start(node_, "lab/arm0", config, sink);
  ASSERT_TRUE(consumer) << consumer.error().text();
  ASSERT_TRUE(test::await([&] { return sink.count > 0; }));
  const std::string former = arm->url();
  kill_device();
  EXPECT_FALSE(arm->read());
  // The killed server's name stays bound until its lease ends, which the new server waits for.
  device_ = start_server("rtpm-deviced");
  ASSERT_TRUE(device_);
  ASSERT_NE(device_->url, former);
  const int count = sink.count;
  EXPECT_TRUE(test::await([&] { return arm->read().has_value(); }));
  EXPECT_EQ(arm->url(), device_->url);
  EXPECT_TRUE(test::await([&] { return sink.count > count + 1; }));
  // Commands need a new lease: the client's lease was the former server's.
  EXPECT_EQ(arm->set_force({}).error(), gvd::DeviceOutcome::kNotHolder);
  EXPECT_TRUE(arm->acquire(kPatience));
  EXPECT_TRUE(arm->set_force({}));
}

TEST_F(Names, ComeBackAtOnceToADeviceThatIsRestartedAtItsPort) {
  const std::string port = std::to_string(device_->port());
  const auto before = directory_->resolve("lab/arm0");
  ASSERT_TRUE(before) << before.error().text();
  kill_device();
  device_ = start_server("rtpm-deviced", {"--port", port});
  ASSERT_TRUE(device_);
  const auto after = directory_->resolve("lab/arm0");
  ASSERT_TRUE(after) << after.error().text();
  EXPECT_EQ(after->url, before->url);
  EXPECT_NE(after->revision, before->revision);
}

TEST_F(Names, AreTakenFromALivingServerOnlyOnDemandAndLogged) {
  const auto refused = run_program(
      "rtpm-deviced", {"--port", "0", "--registry", registry_->url, "--realtime", "off"});
  expect_one_sentence(refused, 1, {"'lab/arm0' is held by another server", device_->url});
  auto second = start_server("rtpm-deviced", {"--allow-takeover"});
  ASSERT_TRUE(second);
  const auto entry = directory_->resolve("lab/arm0");
  ASSERT_TRUE(entry) << entry.error().text();
  EXPECT_EQ(entry->url, second->url);
  EXPECT_TRUE(device_->process.wait_for_errors("is lost", kPatience));
  const std::string told = errors_at_the_end_of(*registry_);
  expect_text(told, {"rtpm-registryd: the name 'lab/arm0' was taken from '" + device_->url +
                     "', bound from 127.0.0.1, by '" + second->url + "' from 127.0.0.1"});
}

// Each name has an owner of its own and is bound for an hour.
TEST_F(Names, ExpireSoonIfTheirServersAreInvented) {
  std::size_t bound_count = 0;
  std::size_t refused_count = 0;
  for (std::uint64_t i = 0; i < 4094; ++i) {
    const std::string name = "invented/" + std::to_string(i);
    const auto bound = directory_->bind({.name = name,
                                         .url = "rtpm://127.0.0.1:4711/object",
                                         .interface = "lab.Arm",
                                         .owner = {.id = 1'000 + i, .epoch = 1},
                                         .lease = 1h});
    if (bound) {
      ++bound_count;
    } else {
      ASSERT_EQ(bound.error().outcome, names::Outcome::kHostOwnersFull) << bound.error().text();
      ++refused_count;
    }
  }
  EXPECT_GT(refused_count, 0u);
  EXPECT_LT(bound_count, 4094u / 2) << "more than half of the registry is for others";
  const auto report = run_program("rtpm", {"call", registry_->url, "report", "--deadline", "10s"});
  EXPECT_EQ(report.exit_code, 0) << report.errors;
  expect_text(report.output, {"HostOwnersFull", "127.0.0.1", "name_count"});
  // Held names live on, and a name that nobody renews is gone after its first lease.
  EXPECT_EQ(run_servo({"--seconds", "0.5"}).exit_code, 0);
  EXPECT_TRUE(test::await([&] {
    const auto names = directory_->list();
    return names && names->size() == 1;
  }));
  const auto other = start_server("rtpm-deviced", {"--devices", "arm1"});
  EXPECT_TRUE(other);
  const std::string told = errors_at_the_end_of(*registry_);
  EXPECT_NE(told.find("rtpm-registryd: refused a bind from 127.0.0.1"), std::string::npos) << told;
}

}  // namespace
}  // namespace rtpm::system_test
