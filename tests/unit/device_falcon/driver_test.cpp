#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <thread>

#include "faults.hpp"
#include "rtpm/device_falcon/falcon_driver.hpp"
#include "scripted_falcon.hpp"

/// The driver with its thread, and a model of a unit whose time only that thread advances. Tests
/// access the model only while no thread runs.
namespace rtpm::device_falcon {
namespace {

using driver::Command;
using driver::CommandMode;
using driver::ExchangeStatus;
using driver::Fault;
using driver::Vector3;
using test::FalconFault;
using test::FalconModel;
using test::FalconModelConfig;
using test::FalconStep;

constexpr driver::DriverConfig kConfig{.period = std::chrono::milliseconds{1}};
const Vector3 kPush{0, 0, 2};

class FalconDriverTest : public testing::Test {
 protected:
  void make(const FalconModelConfig& config) {
    model_ = std::make_shared<FalconModel>(config);
    driver_ = std::make_unique<FalconDriver>(
        FalconConfig{.serial = "FALCON01",
                     .firmware = FalconModel::firmware(),
                     .thread = {.name = "falcon", .realtime = rt::RealtimeMode::kOff}},
        test::open_scripted(model_));
  }
  void start(const FalconModelConfig& config) {
    make(config);
    ASSERT_TRUE(driver_->configure(kConfig));
    ASSERT_TRUE(driver_->activate());
  }
  ExchangeStatus exchange(const Vector3& force) {
    Command command;
    command.mode = CommandMode::kForce;
    command.cycle_time = now_ += std::chrono::milliseconds{1};
    command.wrench.force_newton = force;
    sample_.faults = {};
    return driver_->exchange(command, sample_);
  }
  /// Exchanges until `is_done`; the unit's own time advances meanwhile.
  bool exchange_until(const Vector3& force, const std::function<bool(ExchangeStatus)>& is_done) {
    for (int i = 0; i < 1'000'000; ++i) {
      if (is_done(exchange(force))) return true;
      std::this_thread::yield();
    }
    return false;
  }

  std::shared_ptr<FalconModel> model_;
  std::unique_ptr<FalconDriver> driver_;
  driver::Sample sample_{};
  MonotonicTime now_{std::chrono::seconds{1000}};
};

TEST_F(FalconDriverTest, HasTheFirstSampleAtOnce) {
  start({});
  ASSERT_EQ(exchange({}), ExchangeStatus::kOk);
  EXPECT_EQ(sample_.analogs[0], 1);
  EXPECT_TRUE(sample_.faults.empty());
  EXPECT_NEAR(sample_.pose.position_m.z, 0, 1e-4) << "relative to the middle of the workspace";
}

TEST_F(FalconDriverTest, PushesTheGripAsTheForcePoints) {
  for (const Vector3& force : {Vector3{3, 0, 0}, Vector3{0, -3, 0}, Vector3{0, 0, 3}}) {
    start({});
    ASSERT_TRUE(exchange_until(force, [&](auto) {
      const Vector3& at = sample_.pose.position_m;
      return at.x * force.x + at.y * force.y + at.z * force.z > 0.007 * 3;
    }));
    EXPECT_EQ(sample_.wrench_applied.force_newton, force);
    driver_->deactivate();
    EXPECT_FALSE(model_->has_force());
  }
}

TEST_F(FalconDriverTest, ReportsASaturatedMotor) {
  start({});
  ASSERT_EQ(exchange({8, 0, 0}), ExchangeStatus::kOk);
  EXPECT_TRUE(sample_.faults.has(Fault::kDeviceSaturated));
  const Vector3& applied = sample_.wrench_applied.force_newton;
  EXPECT_GT(applied.x, 6);
  EXPECT_LT(applied.x, 8);
  EXPECT_EQ(applied.y, 0);
  ASSERT_EQ(exchange({4, 0, 0}), ExchangeStatus::kOk);
  EXPECT_FALSE(sample_.faults.has(Fault::kDeviceSaturated));
}

TEST_F(FalconDriverTest, HasNeitherPositionNorForceUntilItIsHomed) {
  start({.is_homed = false});
  sample_.pose.position_m = {0.001, 0.002, 0.003};
  for (int i = 0; i < 1000; ++i) {
    ASSERT_EQ(exchange(kPush), ExchangeStatus::kOk);
    ASSERT_EQ(sample_.analogs[0], 0);
    ASSERT_EQ(sample_.pose.position_m, (Vector3{0.001, 0.002, 0.003}));
    ASSERT_EQ(sample_.wrench_applied.force_newton, Vector3{});
    ASSERT_TRUE(sample_.faults.has(Fault::kOutsideWorkspace));
    ASSERT_TRUE(sample_.faults.has(Fault::kDeviceSaturated));
  }
  driver_->deactivate();
  EXPECT_FALSE(model_->has_force());
}

TEST_F(FalconDriverTest, CountsItsStopAsWithinTheWorkspace) {
  make({});
  model_->hold_at({0.3, 0, 0});  // Limited by the model's stop.
  ASSERT_TRUE(driver_->configure(kConfig));
  ASSERT_TRUE(driver_->activate());
  ASSERT_TRUE(exchange_until({}, [&](auto) { return sample_.pose.position_m.x > 0.0355; }));
  EXPECT_FALSE(sample_.faults.has(Fault::kOutsideWorkspace)) << "the stop is within it";
}

TEST_F(FalconDriverTest, ScalesForceByItsParameter) {
  make({});
  const auto specs = driver_->parameters();
  ASSERT_EQ(specs.size(), 1u);
  EXPECT_EQ(driver::fault_of(specs[0]), "");
  std::vector<driver::ParameterSetting> settings{{specs[0].name, 20'000.0}};
  ASSERT_TRUE(driver_->set_parameters(settings));
  ASSERT_TRUE(driver_->configure(kConfig));
  ASSERT_TRUE(driver_->activate());
  ASSERT_EQ(exchange({8, 0, 0}), ExchangeStatus::kOk);
  EXPECT_NEAR(sample_.wrench_applied.force_newton.x, 8.0 * 4095 / 4848 / 2, 0.01);
}

TEST_F(FalconDriverTest, IsGoneWithTheUnitAndBackWithIt) {
  for (const auto fault : {FalconFault::kNoDevice, FalconFault::kStall, FalconFault::kNoAnswer,
                           FalconFault::kStatusOnly, FalconFault::kNoEndMark}) {
    SCOPED_TRACE(test::to_string(fault));
    start({.plan = {fault, FalconStep::kPacket, 100}});
    ASSERT_TRUE(exchange_until(kPush, [](auto status) { return status == ExchangeStatus::kGone; }));
    const driver::Sample before = sample_;
    EXPECT_EQ(exchange(kPush), ExchangeStatus::kGone);
    EXPECT_EQ(sample_.pose.position_m, before.pose.position_m);
    driver_->deactivate();
    const bool hears = fault != FalconFault::kNoDevice && fault != FalconFault::kStall;
    if (hears) {
      EXPECT_FALSE(model_->has_force());
    } else {
      EXPECT_FALSE(driver_->configure(kConfig));
    }
    model_->set_plan({});
    model_->plug_in();
    ASSERT_TRUE(driver_->configure(kConfig));
    EXPECT_FALSE(model_->has_force());
    ASSERT_TRUE(driver_->activate());
    EXPECT_EQ(exchange({}), ExchangeStatus::kOk);
  }
}

TEST_F(FalconDriverTest, ReportsLateAndCorrupt) {
  start({.plan = {FalconFault::kLate, FalconStep::kPacket, 30}});
  EXPECT_TRUE(exchange_until(kPush, [](auto status) { return status == ExchangeStatus::kLate; }));
  start({.plan = {FalconFault::kFlippedByte, FalconStep::kPacket, 30, 1}});
  EXPECT_TRUE(
      exchange_until(kPush, [](auto status) { return status == ExchangeStatus::kCorrupt; }));
  EXPECT_TRUE(exchange_until(kPush, [](auto status) { return status == ExchangeStatus::kOk; }));
}

TEST_F(FalconDriverTest, RefusesImpossibleEncoderValues) {
  start({});
  driver_->deactivate();
  model_->set_plan({FalconFault::kShort, FalconStep::kPacket, 1});
  ASSERT_TRUE(driver_->configure(kConfig));
  const auto activated = driver_->activate();
  ASSERT_FALSE(activated);
  EXPECT_NE(activated.error().text().find("power"), std::string::npos);
}

TEST_F(FalconDriverTest, EndsTheForceWhenItIsDestroyed) {
  start({});
  ASSERT_TRUE(exchange_until(kPush, [&](auto) { return sample_.pose.position_m.z > 0.003; }));
  driver_.reset();
  EXPECT_FALSE(model_->has_force());
}

class FalconDriverFaults : public FalconDriverTest,
                           public testing::WithParamInterface<FalconFault> {};

TEST_P(FalconDriverFaults, EndWithoutForceAndWithSoundSamples) {
  for (const std::uint64_t from : {0u, 15u, 60u}) {
    SCOPED_TRACE(testing::Message() << "from " << from);
    make({.plan = {GetParam(), FalconStep::kPacket, from}});
    bool is_active = driver_->configure(kConfig).has_value() && driver_->activate().has_value();
    for (int i = 0; i < 2000 && is_active; ++i) {
      is_active = exchange(kPush) != ExchangeStatus::kGone;
      const Vector3& at = sample_.pose.position_m;
      ASSERT_LT(std::hypot(at.x, at.y, at.z), 0.06);
    }
    driver_->deactivate();
    model_->set_plan({});
    model_->plug_in();
    ASSERT_TRUE(driver_->configure(kConfig));
    EXPECT_FALSE(model_->has_force());
    ASSERT_TRUE(driver_->activate());
    EXPECT_EQ(exchange({}), ExchangeStatus::kOk);
  }
}

INSTANTIATE_TEST_SUITE_P(All, FalconDriverFaults, testing::ValuesIn(test::all_faults()),
                         [](const auto& test) { return test::to_string(test.param); });

}  // namespace
}  // namespace rtpm::device_falcon
