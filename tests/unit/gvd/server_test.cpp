#include "rtpm/gvd/server.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <functional>
#include <limits>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "rtpm/device_sim/sim_driver.hpp"
#include "rtpm/gvd/client.hpp"
#include "rtpm/gvd/poller.hpp"
#include "rtpm/models/evaluator.hpp"
#include "rtpm/rpc/node.hpp"
#include "rtpm/rpc/server.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/memory.hpp"
#include "rtpm/test/alloc_guard.hpp"
#include "rtpm/test/os.hpp"
#include "scripted_driver.hpp"

/// A device served and used in one process, over the loopback network.
namespace rtpm::gvd {
namespace {

using rtpm::test::await;

using driver::ExchangeStatus;
using driver::Fault;
using driver::Lifecycle;
using std::chrono::milliseconds;
using std::chrono::seconds;

DeviceServerConfig off_realtime() {
  DeviceServerConfig config;
  config.thread.realtime = rt::RealtimeMode::kOff;
  return config;
}

class Served : public ::testing::Test {
 protected:
  void serve(std::unique_ptr<driver::Driver> driver, DeviceServerConfig config = off_realtime()) {
    prepare(std::move(driver), std::move(config));
    ASSERT_TRUE(server_->start());
  }
  /// The device has its URL, but does not answer before the server starts.
  void prepare(std::unique_ptr<driver::Driver> driver, DeviceServerConfig config) {
    auto device = DeviceServer::create(std::move(driver), std::move(config));
    ASSERT_TRUE(device) << device.error().text();
    device_ = std::move(*device);
    auto server = rpc::Server::create(
        {.lanes = {{.name = "low"}, {.name = "high", .low = 16384, .priority = 16384}},
         .realtime = rt::RealtimeMode::kOff});
    ASSERT_TRUE(server) << server.error().text();
    server_ = std::move(*server);
    ASSERT_TRUE(server_->add("lab/arm0", device_->servant()));
    const auto device_started = device_->start();
    ASSERT_TRUE(device_started) << device_started.error().text();
    url_ = server_->url("lab/arm0");
  }
  void serve_sim() {
    auto sim = device_sim::SimDriver::create({});
    ASSERT_TRUE(sim);
    serve(std::move(*sim));
  }
  DeviceClient open() {
    auto client = DeviceClient::open(node_, url_);
    RTPM_ASSERT(client.has_value(), "the device could not be opened");
    return std::move(*client);
  }
  /// Sends `newton` along x in every cycle until `condition` holds.
  template <class Condition>
  bool command_until(DeviceClient& client, double newton, Condition condition) {
    return await([&] {
      static_cast<void>(client.set_force({newton, 0, 0}));
      return condition();
    });
  }

  std::unique_ptr<DeviceServer> device_;
  std::unique_ptr<rpc::Server> server_;
  std::string url_;
  rpc::Node node_{{.default_deadline = seconds{5}}};
};

/// Allows commands to arrive within their hold on a machine that is busy with other tests.
rpc::CallOptions patient() {
  rpc::CallOptions options;
  options.deadline = seconds{5};
  return options;
}

TEST_F(Served, IsWaitedForByAPatientClient) {
  prepare(std::make_unique<test::ScriptedDriver>(), off_realtime());
  DeviceClientOptions options;
  options.bind.deadline = milliseconds{50};
  EXPECT_FALSE(DeviceClient::open(node_, url_, options));
  options.patience = seconds{30};
  options.bind.deadline = seconds{5};
  std::thread start([&] { EXPECT_TRUE(server_->start()); });
  const auto client = DeviceClient::open(node_, url_, options);
  start.join();
  ASSERT_TRUE(client) << client.error().text();
  EXPECT_EQ(client->descriptor().model, "scripted");
}

TEST_F(Served, GivesALostLeaseBackToTheClientThatLostIt) {
  serve_sim();
  DeviceClient client = open();
  ASSERT_TRUE(client.acquire(seconds{10}));
  EXPECT_TRUE(client.reacquire()) << "it is held";
  ASSERT_TRUE(await([&] { return client.lease_state().value() == LeaseState::kSilent; }));
  EXPECT_FALSE(client.renew());
  EXPECT_TRUE(client.reacquire(seconds{10}));
  EXPECT_EQ(client.lease_state().value(), LeaseState::kHeld);
}

TEST_F(Served, GivesNoLeaseBackThatAnOperatorTook) {
  serve_sim();
  DeviceClient client = open();
  DeviceClient operators = open();
  ASSERT_TRUE(client.acquire(seconds{10}));
  ASSERT_TRUE(operators.take_over());
  EXPECT_EQ(client.reacquire().error(), DeviceOutcome::kNotHolder);
  ASSERT_TRUE(operators.release());
  EXPECT_EQ(client.reacquire().error(), DeviceOutcome::kNotHolder);
  EXPECT_TRUE(client.acquire(seconds{10})) << "who asks gets it";
}

TEST_F(Served, GivesTheCyclesAroundAnEmergencyStop) {
  serve_sim();
  DeviceClient client = open();
  auto log = client.flight_record();
  ASSERT_TRUE(log);
  EXPECT_EQ(log->number, 0u) << "there was no fault";
  ASSERT_TRUE(client.emergency_stop());
  ASSERT_TRUE(await([&] {
    log = client.flight_record();
    return log && log->number == 1;
  }));
  EXPECT_EQ(log->cause, FlightCause::kEmergencyStop);
  ASSERT_EQ(log->records.size(), log->record_count);
  ASSERT_GT(log->records.size(), FlightRecorder::kAfterCount) << "of several parts";
  for (std::size_t i = 1; i < log->records.size(); ++i)
    ASSERT_EQ(log->records[i].cycle, log->records[0].cycle + i);
  const FlightRecord& at_fault = log->records.at(log->cycle - log->records[0].cycle);
  EXPECT_TRUE(at_fault.faults.has(driver::Fault::kEmergencyStop));
  EXPECT_EQ(to_csv(*log), to_csv(device_->flight_recorder().newest())) << "as it is in the server";
}

TEST_F(Served, IsDescribedAcrossTheNetworkAsItIs) {
  auto scripted = std::make_unique<test::ScriptedDriver>();
  scripted->descriptor.joints = {{"elbow", "rad", -1, 2, 3, 0.5}};
  scripted->descriptor.outputs = {{"lamp", "1", 0, 2, 0.25}};
  serve(std::move(scripted));
  const driver::Descriptor local = device_->descriptor();
  const DeviceClient client = open();
  const driver::Descriptor& remote = client.descriptor();
  EXPECT_EQ(remote.device_class, local.device_class);
  EXPECT_EQ(remote.model, "scripted");
  EXPECT_EQ(remote.serial, "s-1");
  EXPECT_EQ(remote.frame, "scripted/base");
  ASSERT_EQ(remote.axes.size(), 1u);
  EXPECT_EQ(remote.axes[0].name, "x");
  EXPECT_TRUE(remote.axes[0].is_actuated);
  EXPECT_EQ(remote.buttons, local.buttons);
  ASSERT_EQ(remote.analogs.size(), 1u);
  EXPECT_EQ(remote.analogs[0].unit, "N");
  EXPECT_EQ(remote.analogs[0].high, 10);
  ASSERT_EQ(remote.joints.size(), 1u);
  EXPECT_EQ(remote.joints[0].name, "elbow");
  EXPECT_EQ(remote.joints[0].low, -1);
  EXPECT_EQ(remote.joints[0].high, 2);
  EXPECT_EQ(remote.joints[0].velocity_max, 3);
  EXPECT_EQ(remote.joints[0].effort_max, 0.5);
  ASSERT_EQ(remote.outputs.size(), 1u);
  EXPECT_EQ(remote.outputs[0].unit, "1");
  EXPECT_EQ(remote.outputs[0].high, 2);
  EXPECT_EQ(remote.outputs[0].safe, 0.25);
  EXPECT_EQ(remote.modes, local.modes);
  EXPECT_EQ(remote.limits.force_newton_max, 8);
  EXPECT_EQ(remote.limits.torque_newton_metre_max, 0.5);
  EXPECT_EQ(remote.limits.stiffness_newton_per_m_max, 500);
  EXPECT_EQ(remote.limits.damping_newton_s_per_m, 1.5);
  EXPECT_EQ(remote.workspace.high_m, (driver::Vector3{1, 2, 3}));
  EXPECT_EQ(remote.position_resolution_m, 1e-5);
  EXPECT_NEAR(remote.rate_hz, 1000, 1e-6);
  EXPECT_EQ(client.url(), url_);
  EXPECT_EQ(client.force_end(), milliseconds{31}) << "hold, ramp and one period";
}

TEST_F(Served, EveryFieldOfASampleArrives) {
  auto scripted = std::make_unique<test::ScriptedDriver>();
  scripted->script = [](const driver::Command& command, driver::Sample& sample) {
    sample.host_time = command.cycle_time;
    sample.device_time = Duration{77};
    sample.pose = {{1, 2, 3}, {0.5, 0.5, -0.5, 0.5}};
    sample.twist = {{4, 5, 6}, {7, 8, 9}};
    sample.wrench_applied = {{10, 11, 12}, {13, 14, 15}};
    for (std::size_t i = 0; i < driver::kAnalogCountMax; ++i) {
      sample.analogs[i] = static_cast<float>(i) + 0.5F;
    }
    for (std::size_t i = 0; i < driver::kButtonCountMax; ++i) {
      sample.button_edges[i] = static_cast<std::uint16_t>(1000 + i);
    }
    for (std::size_t i = 0; i < driver::kJointCountMax; ++i) {
      sample.joints[i] = static_cast<double>(i) + 0.25;
      sample.joint_velocities[i] = static_cast<double>(i) + 0.5;
      sample.efforts_applied[i] = static_cast<double>(i) + 0.75;
      sample.outputs_applied[i] = static_cast<float>(i) + 0.125F;
    }
    sample.buttons = 0x8001;
    sample.faults.set(Fault::kOutsideWorkspace);
    return ExchangeStatus::kOk;
  };
  serve(std::move(scripted));
  DeviceClient client = open();
  const auto sample = client.read(patient());
  ASSERT_TRUE(sample) << to_string(sample.error());
  EXPECT_GT(sample->sequence, 0u);
  EXPECT_GT(sample->host_time, MonotonicTime{});
  EXPECT_LE(sample->host_time, rt::now());
  EXPECT_EQ(sample->device_time, Duration{77});
  EXPECT_EQ(sample->pose.position_m, (driver::Vector3{1, 2, 3}));
  EXPECT_EQ(sample->pose.orientation, (driver::Quaternion{0.5, 0.5, -0.5, 0.5}));
  EXPECT_EQ(sample->twist.linear_m_per_s, (driver::Vector3{4, 5, 6}));
  EXPECT_EQ(sample->twist.angular_rad_per_s, (driver::Vector3{7, 8, 9}));
  EXPECT_EQ(sample->wrench_applied.force_newton, (driver::Vector3{10, 11, 12}));
  EXPECT_EQ(sample->wrench_applied.torque_newton_metre, (driver::Vector3{13, 14, 15}));
  EXPECT_EQ(sample->joints[7], 7.25);
  EXPECT_EQ(sample->joint_velocities[7], 7.5);
  EXPECT_EQ(sample->efforts_applied[7], 7.75);
  EXPECT_EQ(sample->outputs_applied[7], 7.125F);
  EXPECT_EQ(sample->analogs[7], 7.5F);
  EXPECT_EQ(sample->button_edges[0], 1000);
  EXPECT_EQ(sample->button_edges[15], 1015);
  EXPECT_EQ(sample->buttons, 0x8001u);
  EXPECT_TRUE(sample->faults.has(Fault::kOutsideWorkspace));
  EXPECT_EQ(sample->lifecycle, Lifecycle::kActive);
  EXPECT_GT(sample->success_rate, 0);
}

TEST_F(Served, AForceReachesTheDeviceAndEndsWithTheLease) {
  serve_sim();
  DeviceClient client = open();
  ASSERT_TRUE(client.acquire());
  ASSERT_TRUE(command_until(client, 3, [&] {
    return std::abs(device_->newest()->wrench_applied.force_newton.x - 3) < 0.01;
  }));
  ASSERT_TRUE(client.release());
  EXPECT_TRUE(await([&] { return device_->newest()->wrench_applied.force_newton.x == 0; }));
  EXPECT_FALSE(device_->newest()->faults.has(Fault::kCommandLost)) << "it was given back in order";
}

TEST_F(Served, AClientThatFallsSilentLosesForceAndThenTheLease) {
  DeviceServerConfig config = off_realtime();
  config.cycle.lease.silence_max = milliseconds{200};
  auto sim = device_sim::SimDriver::create({});
  ASSERT_TRUE(sim);
  serve(std::move(*sim), config);
  DeviceClient client = open();
  ASSERT_TRUE(client.acquire());
  ASSERT_TRUE(command_until(client, 3,
                            [&] { return device_->newest()->wrench_applied.force_newton.x > 2; }));
  EXPECT_TRUE(await([&] { return device_->newest()->faults.has(Fault::kCommandLost); }));
  EXPECT_TRUE(await([&] { return device_->counters().lease_expired_count == 1; }));
  EXPECT_EQ(device_->newest()->wrench_applied.force_newton.x, 0);
  EXPECT_EQ(client.set_force({1, 0, 0}, patient()).error(), DeviceOutcome::kNotHolder);
}

TEST_F(Served, OneClientCommandsAtATimeAndAllRead) {
  serve_sim();
  DeviceClient holder = open();
  DeviceClient other = open();
  EXPECT_EQ(other.set_force({1, 0, 0}, patient()).error(), DeviceOutcome::kNotHolder);
  ASSERT_TRUE(holder.acquire());
  EXPECT_EQ(other.acquire(Duration{0}).error(), DeviceOutcome::kHeld);
  EXPECT_EQ(other.set_force({1, 0, 0}, patient()).error(), DeviceOutcome::kNotHolder);
  EXPECT_EQ(other.deactivate().error(), DeviceOutcome::kNotHolder);
  EXPECT_EQ(other.recover().error(), DeviceOutcome::kNotHolder);
  EXPECT_EQ(other.renew().error(), DeviceOutcome::kNotHolder);
  EXPECT_TRUE(other.read(patient()));
  EXPECT_TRUE(holder.set_force({1, 0, 0}, patient()));
  ASSERT_TRUE(holder.release());
  EXPECT_TRUE(other.acquire());
  EXPECT_GE(device_->counters().foreign_command_count, 2u);
}

TEST_F(Served, AnOperatorTakesTheDeviceOverAndTheFormerHolderLearnsWhy) {
  serve_sim();
  DeviceClient holder = open();
  DeviceClient other = open();
  EXPECT_EQ(other.operator_priority(), Priority{28000});
  ASSERT_TRUE(holder.acquire());
  ASSERT_TRUE(command_until(holder, 3,
                            [&] { return device_->newest()->wrench_applied.force_newton.x > 2; }));
  EXPECT_EQ(other.take_over(Priority{27999}).error(), DeviceOutcome::kBelowOperatorPriority);
  ASSERT_TRUE(holder.renew());
  EXPECT_EQ(*holder.lease_state(), LeaseState::kHeld);

  ASSERT_TRUE(other.take_over());
  EXPECT_EQ(holder.set_force({3, 0, 0}, patient()).error(), DeviceOutcome::kNotHolder);
  EXPECT_EQ(holder.renew().error(), DeviceOutcome::kNotHolder);
  EXPECT_EQ(*holder.lease_state(), LeaseState::kTakenOver);
  EXPECT_EQ(*other.lease_state(), LeaseState::kHeld);
  EXPECT_TRUE(await([&] { return device_->newest()->wrench_applied.force_newton.x == 0; }));
  EXPECT_TRUE(command_until(other, -3,
                            [&] { return device_->newest()->wrench_applied.force_newton.x < -2; }));
  EXPECT_EQ(holder.take_over().error(), DeviceOutcome::kTooSoon) << "not so soon";
  EXPECT_EQ(device_->counters().lease_taken_over_count, 1u);
}

TEST_F(Served, AClientGivesTheLeaseBackAtItsEnd) {
  serve_sim();
  {
    DeviceClient client = open();
    ASSERT_TRUE(client.acquire());
  }
  DeviceClient next = open();
  EXPECT_TRUE(next.acquire());
}

TEST_F(Served, ANonFiniteNumberIsReportedAndEndsTheForceUntilRecovery) {
  serve_sim();
  DeviceClient client = open();
  ASSERT_TRUE(client.acquire());
  EXPECT_EQ(client.set_force({std::numeric_limits<double>::quiet_NaN(), 0, 0}, patient()).error(),
            DeviceOutcome::kNotFinite);
  ASSERT_TRUE(await([&] { return device_->newest()->faults.has(Fault::kCommandNotFinite); }));
  ASSERT_TRUE(client.recover());
  EXPECT_TRUE(command_until(client, 3,
                            [&] { return device_->newest()->wrench_applied.force_newton.x > 1; }));
}

TEST_F(Served, ModelsOfEveryKindAreRenderedAsTheClientSetThem) {
  driver::Sample at;
  at.pose.position_m = {0.01, -0.02, -0.004};
  at.twist.linear_m_per_s = {0.1, -0.2, 0.3};
  auto scripted = std::make_unique<test::ScriptedDriver>();
  scripted->script = [at](const driver::Command&, driver::Sample& sample) {
    sample.pose = at.pose;
    sample.twist = at.twist;
    return ExchangeStatus::kOk;
  };
  serve(std::move(scripted));
  DeviceClient client = open();
  EXPECT_EQ(client.set_models({}).error().error, DeviceOutcome::kNotHolder);
  ASSERT_TRUE(client.acquire());
  std::vector<Model> models{
      Plane{{0, 0, 0.001}, {0, 0, 1}, 200, 0.1},
      Sphere{{0.011, -0.02, 0}, 0.01, Side::kSolid, 100, 0.2},
      Sphere{{0.1, 0, 0}, 0.08, Side::kHollow, 90, 0},
      Box{{0, -0.03, -0.01}, {0.02, 0.01, 0.05}, Side::kSolid, 80, 0.1},
      Box{{0.02, 0, 0}, {0.03, 0.03, 0.03}, Side::kHollow, 40, 0.1},
      Spring{{0.02, 0.03, 0.04}, 50, 0.15, 1.5},
      AffineField{{0.001, 0.002, 0.003}, {0.1, 0.2, 0.3}, {1, 2, 3, 4, 5, 6, 7, 8, 9}, 0.02, 0.05},
      Friction{0, 0, 0.3},
      Detents{{0.001, 0.002, 0.003}, {0, 1, 0}, 0.03, 0.4, 0.05},
      DialDetents{.spacing_rad = 1}};
  models.resize(ModelList::kCountMax, Friction{});
  Evaluator evaluator;
  evaluator.set(ModelList{models});
  const driver::Vector3 expected = evaluator.evaluate(at).wrench.force_newton;
  ASSERT_GT(std::hypot(expected.x, expected.y, expected.z), 1);
  ASSERT_LT(std::hypot(expected.x, expected.y, expected.z), 8) << "the device's limit";
  const auto is_rendered = [&] {
    if (!client.set_models(models)) return false;
    const auto sample = client.read(patient());
    if (!sample) return false;
    const driver::Vector3 applied = sample->wrench_applied.force_newton;
    return std::hypot(applied.x - expected.x, applied.y - expected.y, applied.z - expected.z) <
           1e-9;
  };
  EXPECT_TRUE(await(is_rendered));
  ASSERT_TRUE(client.set_models({}));
  EXPECT_TRUE(await([&] {
    const auto sample = client.read(patient());
    return sample && sample->wrench_applied == driver::Wrench{};
  }));
}

TEST_F(Served, RefusesModelsThatCannotBeRendered) {
  serve_sim();
  DeviceClient client = open();
  ASSERT_TRUE(client.acquire());
  const auto text_of = [&client](const std::vector<Model>& models) {
    const auto refused = client.set_models(models);
    if (refused) return std::string("rendered");
    EXPECT_EQ(refused.error().error, DeviceOutcome::kOutOfRange);
    return refused.error().text;
  };
  EXPECT_EQ(text_of({Friction{}, Plane{{}, {0, 0, 1}, 1e9, 0}}),
            "model 1 (plane): stiffness_newton_per_m is 1e+09; choose 0 to 1667");
  EXPECT_EQ(text_of({Sphere{{}, std::numeric_limits<double>::quiet_NaN(), Side::kSolid, 1, 0}}),
            "model 0 (sphere): radius_m is nan; choose 1e-09 to 100");
  EXPECT_EQ(text_of({DialDetents{.joint = 9}}),
            "model 0 (dial detents): joint is 9; choose 0 to 7");
  EXPECT_EQ(text_of(std::vector<Model>(17, Friction{})), "17 models; send at most 16");
  EXPECT_EQ(text_of(std::vector<Model>(16, Friction{})), "rendered");
  ASSERT_TRUE(client.emergency_stop());
  const auto stopped = client.set_models({});
  ASSERT_FALSE(stopped);
  EXPECT_EQ(stopped.error().error, DeviceOutcome::kEmergencyStop);
  EXPECT_EQ(stopped.error().text, to_string(DeviceError{DeviceOutcome::kEmergencyStop}));
}

TEST_F(Served, IsTakenOutOfAndIntoOperation) {
  serve_sim();
  DeviceClient client = open();
  ASSERT_TRUE(client.acquire());
  ASSERT_TRUE(client.deactivate());
  const auto is_in = [&](Lifecycle lifecycle) {
    const auto sample = client.read(patient());
    return sample && sample->lifecycle == lifecycle;
  };
  ASSERT_TRUE(await([&] { return is_in(Lifecycle::kInactive); }));
  EXPECT_EQ(client.set_force({1, 0, 0}, patient()).error(), DeviceOutcome::kNotActive);
  ASSERT_TRUE(client.activate());
  EXPECT_TRUE(await([&] { return is_in(Lifecycle::kActive); }));
}

TEST_F(Served, AnyClientStopsADeviceAndItsHolderRearmsIt) {
  serve_sim();
  DeviceClient holder = open();
  DeviceClient other = open();
  ASSERT_TRUE(holder.acquire());
  ASSERT_TRUE(command_until(holder, 3,
                            [&] { return device_->newest()->wrench_applied.force_newton.x > 2; }));
  ASSERT_TRUE(other.emergency_stop());
  EXPECT_TRUE(await([&] { return device_->newest()->wrench_applied.force_newton.x == 0; }));
  EXPECT_EQ(holder.set_force({3, 0, 0}, patient()).error(), DeviceOutcome::kEmergencyStop);
  EXPECT_EQ(other.rearm().error(), DeviceOutcome::kNotHolder);
  ASSERT_TRUE(holder.rearm());
  EXPECT_TRUE(command_until(holder, 3,
                            [&] { return device_->newest()->wrench_applied.force_newton.x > 2; }));
}

TEST_F(Served, ReadsAndCommandsAllocateNothingOnEitherSide) {
  if (!test::is_alloc_guard_active()) GTEST_SKIP() << test::kAllocGuardInactive;
  serve_sim();
  DeviceClient client = open();
  ASSERT_TRUE(client.acquire());
  ASSERT_TRUE(client.read(patient()));
  ASSERT_TRUE(client.set_force({1, 0, 0}, patient()));
  const test::CountBreachesOnly counting;
  const std::uint64_t before = test::allocation_breach_count();
  {
    const rt::NoAllocationScope no_allocation;
    for (int i = 0; i < 200; ++i) {
      static_cast<void>(client.read(patient()));
      static_cast<void>(client.set_force({1, 0, 0}, patient()));
    }
  }
  EXPECT_EQ(test::allocation_breach_count(), before);
}

TEST_F(Served, StoppingTakesTheForceAway) {
  auto scripted = std::make_unique<test::ScriptedDriver>();
  const test::ScriptedDriver& watched = *scripted;
  serve(std::move(scripted));
  device_->stop();
  EXPECT_FALSE(watched.is_active);
  EXPECT_EQ(device_->newest()->lifecycle, Lifecycle::kFinalized);
  device_->stop();
}

TEST(DeviceServer, SaysWhyADeviceCantBeSetUp) {
  auto scripted = std::make_unique<test::ScriptedDriver>();
  scripted->configure_error = "the cable is out; plug it in.";
  auto device = DeviceServer::create(std::move(scripted), off_realtime());
  ASSERT_TRUE(device);
  const auto started = (*device)->start();
  ASSERT_FALSE(started);
  EXPECT_EQ(started.error().text(), "the cable is out; plug it in.");
}

TEST(DeviceServer, RefusesAnInvalidPeriodSafetyOrLease) {
  DeviceServerConfig config = off_realtime();
  config.cycle.period = Duration{0};
  const auto timeless = DeviceServer::create(std::make_unique<test::ScriptedDriver>(), config);
  ASSERT_FALSE(timeless);
  EXPECT_NE(timeless.error().text().find("period"), std::string::npos);
  config = off_realtime();
  config.cycle.safety = SafetyConfig{};
  config.cycle.safety->force_newton_max = -1;
  const auto unsafe = DeviceServer::create(std::make_unique<test::ScriptedDriver>(), config);
  ASSERT_FALSE(unsafe);
  EXPECT_NE(unsafe.error().text().find("force_newton_max"), std::string::npos);
  config = off_realtime();
  config.cycle.lease.idle_max = Duration{0};
  const auto idle = DeviceServer::create(std::make_unique<test::ScriptedDriver>(), config);
  ASSERT_FALSE(idle);
  EXPECT_NE(idle.error().text().find("idle_max"), std::string::npos);
}

TEST(DeviceServer, RefusesAnInvalidDescriptor) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double infinite = std::numeric_limits<double>::infinity();
  const std::vector<std::pair<std::string, std::function<void(driver::Descriptor&)>>> faults{
      {"serial", [](auto& descriptor) { descriptor.serial.clear(); }},
      {"more buttons", [](auto& descriptor) { descriptor.buttons.resize(17); }},
      {"limit", [&](auto& descriptor) { descriptor.limits.force_newton_max = nan; }},
      {"limit", [&](auto& descriptor) { descriptor.limits.velocity_m_per_s_max = infinite; }},
      {"limit", [](auto& descriptor) { descriptor.limits.torque_newton_metre_max = -1; }},
      {"workspace", [&](auto& descriptor) { descriptor.workspace.low_m.y = nan; }},
      {"workspace", [](auto& descriptor) { descriptor.workspace.low_m.y = 5; }},
      {"\"grip\"", [&](auto& descriptor) { descriptor.analogs[0].high = nan; }},
      {"\"elbow\"",
       [&](auto& descriptor) {
         descriptor.joints = {{"elbow", "rad", nan, 1, 1, 1}};
       }},
      {"\"lamp\"",
       [](auto& descriptor) {
         descriptor.outputs = {{"lamp", "1", 0, 1, 2}};
       }},
      {"mode", [](auto& descriptor) {
         descriptor.modes = {static_cast<driver::CommandMode>(driver::kCommandModeCount)};
       }}};
  for (const auto& [word, spoil] : faults) {
    auto scripted = std::make_unique<test::ScriptedDriver>();
    spoil(scripted->descriptor);
    const auto device = DeviceServer::create(std::move(scripted), off_realtime());
    ASSERT_FALSE(device) << word;
    EXPECT_NE(device.error().text().find("\"scripted\""), std::string::npos);
    EXPECT_NE(device.error().text().find(word), std::string::npos) << device.error().text();
  }
}

class Collector final : public SampleSink {
 public:
  void push(const driver::Sample& sample) override {
    if (sample.sequence <= last_sequence) is_in_order = false;
    last_sequence = sample.sequence;
    ++count;
  }
  std::atomic<int> count{0};
  std::atomic<bool> is_in_order{true};
  std::uint64_t last_sequence = 0;
};

TEST_F(Served, APollerReceivesNewSamplesAtItsOwnPace) {
  serve_sim();
  Collector collector;
  auto consumer = DevicePoller::start(node_, url_, {.rate_hz = 200}, collector);
  ASSERT_TRUE(consumer) << consumer.error().text();
  EXPECT_TRUE(await([&] { return collector.count > 10; }));
  consumer->stop();
  const int count = collector.count;
  EXPECT_TRUE(collector.is_in_order);
  EXPECT_EQ(consumer->counters().pushed_count, static_cast<std::uint64_t>(count));
  EXPECT_FALSE(consumer->last_error());
}

TEST_F(Served, APollerCountsWhatFailsAndGoesOn) {
  serve_sim();
  Collector collector;
  auto consumer = DevicePoller::start(node_, url_, {.rate_hz = 1000}, collector);
  ASSERT_TRUE(consumer);
  EXPECT_TRUE(await([&] { return collector.count > 0; }));
  server_->stop();
  EXPECT_TRUE(await([&] { return consumer->counters().failed_count > 0; }));
  EXPECT_TRUE(consumer->last_error());
}

TEST_F(Served, APollerRefusesAnInvalidRate) {
  Collector collector;
  const auto consumer = DevicePoller::start(node_, "x", {.rate_hz = 0}, collector);
  ASSERT_FALSE(consumer);
  EXPECT_EQ(consumer.error().remedy, "choose 0.1 to 10000 Hz");
}

TEST_F(Served, AMissingDeviceIsAnError) {
  const auto client = DeviceClient::open(node_, "rtpm://127.0.0.1:9/lab/arm0");
  ASSERT_FALSE(client);
  EXPECT_GT(client.error().text().size(), 20u);
}

}  // namespace
}  // namespace rtpm::gvd
