#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <memory>
#include <string>

#include "recorded_run.hpp"
#include "rtpm/gvd/client.hpp"
#include "rtpm/gvd/server.hpp"
#include "rtpm/replay/replayed_device.hpp"
#include "rtpm/rpc/node.hpp"
#include "rtpm/rpc/server.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/thread.hpp"

// A replayed device keeps a device's promises to its clients, too: each test runs with both.
namespace rtpm::replay {
namespace {

using gvd::DeviceOutcome;
using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr gvd::LeaseConfig kLease{.silence_max = milliseconds{300},
                                  .acquire_interval = milliseconds{1},
                                  .take_over_interval = milliseconds{200}};

/// A device that is served.
class Subject {
 public:
  Subject() = default;
  Subject(const Subject&) = delete;
  Subject& operator=(const Subject&) = delete;
  virtual ~Subject() = default;
  [[nodiscard]] virtual rpc::Servant& servant() = 0;
};

class RealDevice final : public Subject {
 public:
  RealDevice() {
    gvd::DeviceServerConfig config;
    config.cycle.lease = kLease;
    config.thread.realtime = rt::RealtimeMode::kOff;
    auto server = gvd::DeviceServer::create(std::make_unique<test::ScriptedDriver>(), config);
    RTPM_ASSERT(server.has_value() && (*server)->start().has_value(), "the device does not start");
    server_ = std::move(*server);
  }
  [[nodiscard]] rpc::Servant& servant() override { return server_->servant(); }

 private:
  std::unique_ptr<gvd::DeviceServer> server_;
};

class Replayed final : public Subject {
 public:
  Replayed() {
    auto thread = rt::Thread::start({.name = "attend"}, [this] {
      while (!is_stopping_) {
        device_.attend(rt::now());
        rt::sleep_until(rt::now() + milliseconds{1});
      }
    });
    RTPM_ASSERT(thread.has_value(), "no thread");
    thread_ = std::move(*thread);
  }
  ~Replayed() override {
    is_stopping_ = true;
    thread_.join();
  }
  [[nodiscard]] rpc::Servant& servant() override { return device_; }

 private:
  RecordedDevice recorded_ = lever(3);
  ReplayedDevice device_{recorded_, {.end = End::kHold, .lease = kLease, .lease_key = {3, 4}}};
  std::atomic<bool> is_stopping_{false};
  rt::Thread thread_{};
};

class Answers : public testing::TestWithParam<bool> {
 protected:
  void SetUp() override {
    if (GetParam()) {
      subject_ = std::make_unique<Replayed>();
    } else {
      subject_ = std::make_unique<RealDevice>();
    }
    auto server = rpc::Server::create({.realtime = rt::RealtimeMode::kOff});
    ASSERT_TRUE(server) << server.error().text();
    server_ = std::move(*server);
    ASSERT_TRUE(server_->add("lab/lever", subject_->servant()));
    ASSERT_TRUE(server_->start());
  }
  void TearDown() override { server_->stop(); }
  [[nodiscard]] gvd::DeviceClient open() {
    auto client = gvd::DeviceClient::open(node_, server_->url("lab/lever"));
    RTPM_ASSERT(client.has_value(), "the device could not be opened");
    return std::move(*client);
  }
  [[nodiscard]] device::DeviceClient stub() {
    auto stub = device::DeviceClient::bind(node_, server_->url("lab/lever"));
    RTPM_ASSERT(stub.has_value(), "the device could not be bound");
    return std::move(*stub);
  }
  static void expect_refused(const gvd::DeviceResult& result, DeviceOutcome outcome) {
    ASSERT_FALSE(result);
    EXPECT_EQ(result.error(), outcome) << to_string(result.error());
  }

  std::unique_ptr<Subject> subject_;
  std::unique_ptr<rpc::Server> server_;
  rpc::Node node_{{.default_deadline = seconds{5}}};
};

INSTANTIATE_TEST_SUITE_P(Of, Answers, testing::Bool(), [](const auto& parameter) {
  return parameter.param ? "AReplayedDevice" : "ARealDevice";
});

TEST_P(Answers, DescribeIt) {
  const gvd::DeviceClient client = open();
  EXPECT_EQ(client.descriptor().model, "scripted");
  EXPECT_EQ(client.descriptor().limits.force_newton_max, 8);
  EXPECT_EQ(client.descriptor().buttons, (std::vector<std::string>{"left", "right"}));
  EXPECT_EQ(client.operator_priority(), Priority{28000});
}

TEST_P(Answers, GiveTheLeaseToOneAtATime) {
  gvd::DeviceClient first = open();
  gvd::DeviceClient second = open();
  ASSERT_TRUE(first.acquire());
  EXPECT_TRUE(first.set_force({1, 0, 0}));
  expect_refused(second.acquire(Duration{0}), DeviceOutcome::kHeld);
  expect_refused(second.set_force({1, 0, 0}), DeviceOutcome::kNotHolder);
  EXPECT_TRUE(first.release());
  EXPECT_TRUE(second.acquire());
  EXPECT_TRUE(second.set_force({1, 0, 0}));
}

TEST_P(Answers, EndTheLeaseOfASilentHolder) {
  gvd::DeviceClient client = open();
  ASSERT_TRUE(client.acquire());
  ASSERT_TRUE(await([&] { return *client.lease_state() == gvd::LeaseState::kSilent; }));
  expect_refused(client.set_force({1, 0, 0}), DeviceOutcome::kNotHolder);
  expect_refused(client.renew(), DeviceOutcome::kNotHolder);
}

TEST_P(Answers, LetAnOperatorTakeTheLeaseOver) {
  gvd::DeviceClient holder = open();
  gvd::DeviceClient operator_client = open();
  ASSERT_TRUE(holder.acquire());
  expect_refused(operator_client.take_over(Priority{27999}), DeviceOutcome::kBelowOperatorPriority);
  ASSERT_TRUE(operator_client.take_over());
  expect_refused(holder.set_force({1, 0, 0}), DeviceOutcome::kNotHolder);
  EXPECT_EQ(*holder.lease_state(), gvd::LeaseState::kTakenOver);
  EXPECT_TRUE(operator_client.set_force({1, 0, 0}));
}

TEST_P(Answers, RefuseWhatNoCommandMayBe) {
  gvd::DeviceClient client = open();
  ASSERT_TRUE(client.acquire());
  driver::Setpoint pose;
  pose.mode = driver::CommandMode::kPose;
  expect_refused(client.set(pose), DeviceOutcome::kWrongMode);
  expect_refused(client.set_force({std::numeric_limits<double>::quiet_NaN(), 0, 0}),
                 DeviceOutcome::kNotFinite);
  EXPECT_TRUE(client.recover());
  EXPECT_TRUE(client.set_force({1, 0, 0}));
}

TEST_P(Answers, RefuseACommandThatIsOlderThanTheNewest) {
  device::DeviceClient client = stub();
  const auto lease = client.acquire();
  ASSERT_TRUE(lease);
  const auto command = [&](std::uint32_t sequence) {
    const gvd::ClientCommand force{lease->id(), sequence, milliseconds{10},
                                   driver::Setpoint::with_wrench({{1, 0, 0}, {}})};
    return client.command(gvd::to_wire(force))->code();
  };
  EXPECT_EQ(command(0xffff'fffe), device::OutcomeCode::Done);
  EXPECT_EQ(command(0xffff'fffe), device::OutcomeCode::Superseded);
  EXPECT_EQ(command(0xffff'fffd), device::OutcomeCode::Superseded);
  EXPECT_EQ(command(1), device::OutcomeCode::Done) << "it wraps";
}

TEST_P(Answers, StopInAnEmergencyUntilItIsRearmed) {
  gvd::DeviceClient client = open();
  gvd::DeviceClient other = open();
  ASSERT_TRUE(client.acquire());
  EXPECT_TRUE(other.emergency_stop());
  expect_refused(client.set_force({1, 0, 0}), DeviceOutcome::kEmergencyStop);
  expect_refused(other.rearm(), DeviceOutcome::kNotHolder);
  EXPECT_TRUE(client.rearm());
  EXPECT_TRUE(await([&] { return client.set_force({1, 0, 0}).has_value(); }));
  expect_refused(other.emergency_stop(gvd::StopScope::kSystem), DeviceOutcome::kNotInSystem);
}

TEST_P(Answers, RefuseCommandsWhileItIsDeactivated) {
  gvd::DeviceClient client = open();
  ASSERT_TRUE(client.acquire());
  EXPECT_TRUE(client.deactivate());
  EXPECT_TRUE(await([&] {
    const auto set = client.set_force({1, 0, 0});
    return !set && set.error() == DeviceOutcome::kNotActive;
  }));
  EXPECT_TRUE(client.activate());
  EXPECT_TRUE(await([&] { return client.set_force({1, 0, 0}).has_value(); }));
}

TEST_P(Answers, HaveNoFlightRecordWithoutAFault) {
  gvd::DeviceClient client = open();
  const auto log = client.flight_record();
  ASSERT_TRUE(log);
  EXPECT_EQ(log->number, 0u);
  EXPECT_TRUE(log->records.empty());
}

TEST_P(Answers, TakeAnEmptyListOfModels) {
  gvd::DeviceClient client = open();
  ASSERT_FALSE(client.set_models({}));
  ASSERT_TRUE(client.acquire());
  EXPECT_TRUE(client.set_models({}));
}

TEST(AnswersOfAReplayedDevice, SayThatItRendersNoModels) {
  Replayed subject;
  auto server = rpc::Server::create({.realtime = rt::RealtimeMode::kOff});
  ASSERT_TRUE(server);
  ASSERT_TRUE((*server)->add("lab/lever", subject.servant()));
  ASSERT_TRUE((*server)->start());
  rpc::Node node;
  auto client = gvd::DeviceClient::open(node, (*server)->url("lab/lever"));
  ASSERT_TRUE(client && client->acquire());
  const gvd::Model spring = gvd::Spring{.stiffness_newton_per_m = 1};
  const auto set = client->set_models({&spring, 1});
  ASSERT_FALSE(set);
  EXPECT_EQ(set.error().error, DeviceOutcome::kOutOfRange);
  EXPECT_NE(set.error().text.find("replayed"), std::string::npos) << set.error().text;
}

}  // namespace
}  // namespace rtpm::replay
