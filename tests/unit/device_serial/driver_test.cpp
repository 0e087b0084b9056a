#include "rtpm/device_serial/serial_driver.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <limits>
#include <semaphore>
#include <thread>

#include "rtpm/device_serial/open.hpp"
#include "serial_model.hpp"

/// The driver with its thread and a model of a board. Tests here wait for the expected state and
/// assert no times.
namespace rtpm::device_serial {
namespace {

using driver::Command;
using driver::CommandMode;
using driver::ExchangeStatus;
using driver::Sample;
using std::chrono::milliseconds;
using test::SerialFault;
using test::SerialModel;

constexpr Duration kPeriod = milliseconds{2};

/// The time line advances by one period per exchange(), otherwise at most ten times as fast as real
/// time, so that a request does not expire while the test sleeps.
class PacedPort final : public Transport {
 public:
  explicit PacedPort(std::unique_ptr<Transport> port) : port_(std::move(port)) {}

  [[nodiscard]] Transferred send(ConstBytes bytes) override { return port_->send(bytes); }
  [[nodiscard]] Transferred receive(MutableBytes buffer, Duration patience) override {
    if (is_paced_ && port_->now() >= until_) {
      if (wakes_.try_acquire_for(std::chrono::microseconds{100})) until_ = port_->now() + kPeriod;
    }
    return port_->receive(buffer, patience);
  }
  void wake() noexcept override {
    is_paced_ = true;
    wakes_.release();
  }
  [[nodiscard]] MonotonicTime now() const override { return port_->now(); }

 private:
  std::unique_ptr<Transport> port_;
  std::atomic<bool> is_paced_{false};
  std::counting_semaphore<> wakes_{0};
  MonotonicTime until_{};
};

class SerialDriverTest : public ::testing::Test {
 protected:
  SerialConfig config() const {
    return {.open = [open = test::open_model(model_)](const PortSettings& settings)
                -> expected<std::unique_ptr<Transport>, SetupError> {
              auto port = open(settings);
              if (!port) return unexpected{port.error()};
              return std::make_unique<PacedPort>(std::move(*port));
            },
            .board = fallback_board(),
            .serial = "A",
            .frame = "paddle0/base",
            .realtime = rt::RealtimeMode::kOff};
  }
  void start(SerialDriver& driver) {
    const auto configured = driver.configure({.period = kPeriod});
    ASSERT_TRUE(configured) << configured.error().text();
    const auto activated = driver.activate();
    ASSERT_TRUE(activated) << activated.error().text();
  }
  ExchangeStatus exchange(SerialDriver& driver, CommandMode mode = CommandMode::kOff,
                          double effort = 0, float lamp = 0) {
    Command command;
    command.mode = mode;
    command.cycle_time = now_ += kPeriod;
    command.deadline = now_ + milliseconds{30};
    command.joints.fill(effort);
    command.outputs.fill(lamp);
    sample_.faults = {};
    return driver.exchange(command, sample_);
  }
  /// Cycles until `is_done`, which the board must reach within some seconds of real time.
  template <class IsDone>
  bool run_until(SerialDriver& driver, IsDone&& is_done, CommandMode mode = CommandMode::kOff,
                 double effort = 0, float lamp = 0) {
    for (int i = 0; i < 20'000; ++i) {
      status_ = exchange(driver, mode, effort, lamp);
      if (is_done()) return true;
      std::this_thread::sleep_for(std::chrono::microseconds{100});
    }
    return false;
  }

  std::shared_ptr<SerialModel> model_ = std::make_shared<SerialModel>();
  Sample sample_{};
  ExchangeStatus status_{};
  MonotonicTime now_{std::chrono::seconds{1000}};
};

TEST_F(SerialDriverTest, AppliesEffortWithinTheLimitAndSaysSo) {
  SerialDriver driver(config());
  start(driver);
  EXPECT_TRUE(run_until(
      driver,
      [&] { return sample_.efforts_applied[0] == 0.125 && sample_.outputs_applied[0] == 1; },
      CommandMode::kJointEffort, 1e9, 7));
  for (const double effort : {std::numeric_limits<double>::quiet_NaN(), 0.0}) {
    EXPECT_TRUE(run_until(
        driver, [&] { return sample_.efforts_applied[0] == 0; }, CommandMode::kJointEffort,
        effort));
  }
  driver.deactivate();
  EXPECT_LE(model_->greatest_effort(), 0.125F);
}

TEST_F(SerialDriverTest, SetsOutputsWithoutEffort) {
  SerialDriver driver(config());
  start(driver);
  EXPECT_TRUE(run_until(
      driver, [&] { return sample_.outputs_applied[0] == 0.5F; }, CommandMode::kOutputs, 1, 0.5F));
  driver.deactivate();
  EXPECT_EQ(model_->greatest_effort(), 0);
  EXPECT_EQ(model_->lamp(), 0) << "its safe value at the end";
}

TEST_F(SerialDriverTest, DeactivationEndsTheEffort) {
  SerialDriver driver(config());
  for (int round = 0; round < 2; ++round) {
    start(driver);
    EXPECT_TRUE(run_until(
        driver, [&] { return sample_.efforts_applied[0] > 0; }, CommandMode::kJointEffort, 0.1));
    driver.deactivate();
    EXPECT_EQ(model_->effort(), 0);
  }
  {
    SerialDriver other(config());
    start(other);
    EXPECT_TRUE(run_until(
        other, [&] { return sample_.efforts_applied[0] > 0; }, CommandMode::kJointEffort, 0.1));
  }
  EXPECT_EQ(model_->effort(), 0) << "and so does the destructor";
}

TEST_F(SerialDriverTest, CalibratesAnalogsAndJoints) {
  SerialDriver driver(config());
  std::vector<driver::ParameterSetting> settings{{"analog.offset", std::vector<double>{0.1, 0}},
                                                 {"analog.scale", std::vector<double>{2, 100}},
                                                 {"joint.zero", std::vector<double>{0.04}}};
  ASSERT_TRUE(driver.set_parameters(settings));
  start(driver);
  ASSERT_TRUE(run_until(driver, [&] { return status_ == ExchangeStatus::kOk; }));
  EXPECT_NEAR(sample_.analogs[0], 0.1 + 2 * 0.25, 1e-6);
  EXPECT_EQ(sample_.analogs[1], 1) << "within the analog's range";
  EXPECT_NEAR(sample_.joints[0], 0.1 - 0.04, 1e-6);
}

TEST_F(SerialDriverTest, FindsTheJointsZero) {
  SerialDriver driver(config());
  start(driver);
  ASSERT_TRUE(run_until(driver, [&] { return status_ == ExchangeStatus::kOk; }));
  const auto calibration = driver.make_calibration("joint_zero");
  ASSERT_NE(calibration, nullptr);
  EXPECT_TRUE(
      std::holds_alternative<driver::CalibrationPrompt>(calibration->step(sample_, std::nullopt)));
  driver::CalibrationState state = calibration->step(sample_, "ready");
  while (std::holds_alternative<driver::CalibrationRunning>(state))
    state = calibration->step(sample_, std::nullopt);
  auto* const done = std::get_if<driver::CalibrationDone>(&state);
  ASSERT_NE(done, nullptr);
  ASSERT_TRUE(driver.set_parameters(done->settings));
  EXPECT_EQ(exchange(driver), ExchangeStatus::kOk);
  EXPECT_NEAR(sample_.joints[0], 0, 1e-6);
  const auto moved = driver.make_calibration("joint_zero");
  static_cast<void>(moved->step(sample_, "ready"));
  sample_.joints[0] += 0.1;
  EXPECT_TRUE(
      std::holds_alternative<driver::CalibrationFailed>(moved->step(sample_, std::nullopt)));
}

TEST_F(SerialDriverTest, CountsEdgesAcrossAPause) {
  SerialDriver driver(config());
  model_->press(true);
  start(driver);
  ASSERT_TRUE(run_until(driver, [&] { return status_ == ExchangeStatus::kOk; }));
  EXPECT_EQ(sample_.buttons, 1u);
  EXPECT_EQ(sample_.button_edges[0], 1);
  driver.deactivate();
  model_->press(false);
  start(driver);
  ASSERT_TRUE(run_until(driver, [&] { return status_ == ExchangeStatus::kOk; }));
  EXPECT_EQ(sample_.buttons, 0u);
  EXPECT_EQ(sample_.button_edges[0], 2);
}

TEST_F(SerialDriverTest, ReportsABoardOutsideItsRange) {
  model_->set_position(0.9F);
  SerialDriver driver(config());
  start(driver);
  ASSERT_TRUE(run_until(driver, [&] { return status_ == ExchangeStatus::kOk; }));
  EXPECT_TRUE(sample_.faults.has(driver::Fault::kOutsideWorkspace));
}

TEST_F(SerialDriverTest, RefusesAnotherBoard) {
  SerialConfig named = config();
  named.board.serial = "PADDLE-1";
  SerialDriver driver(named);
  ASSERT_TRUE(driver.configure({.period = kPeriod}));
  driver.deactivate();
  model_->set_serial("PADDLE-2");
  const auto other = driver.configure({.period = kPeriod});
  ASSERT_FALSE(other);
  EXPECT_NE(other.error().text().find("PADDLE-2"), std::string::npos);
  model_->set_serial("PADDLE-1");
  model_->set_joint_name("elbow");
  const auto changed = driver.configure({.period = kPeriod});
  ASSERT_FALSE(changed);
  EXPECT_NE(changed.error().text().find("other channels"), std::string::npos);
}

class SerialDriverFaults : public SerialDriverTest,
                           public ::testing::WithParamInterface<SerialFault> {};

/// Cycles without new data keep the last sample, and the board's effort ends at zero.
TEST_P(SerialDriverFaults, LeaveTheSampleAndEndInZeroEffort) {
  model_ = std::make_shared<SerialModel>(GetParam(), 12);
  SerialDriver driver(config());
  start(driver);
  for (int i = 0; i < 200; ++i) {
    const Sample before = sample_;
    const ExchangeStatus status = exchange(driver, CommandMode::kJointEffort, 0.1, 1);
    if (status != ExchangeStatus::kOk) {
      ASSERT_EQ(sample_.joints, before.joints);
      ASSERT_EQ(sample_.host_time, before.host_time);
      ASSERT_EQ(sample_.button_edges, before.button_edges);
    }
    ASSERT_TRUE(std::isfinite(sample_.joints[0]));
    ASSERT_LE(std::abs(sample_.efforts_applied[0]), 0.125);
    if (status == ExchangeStatus::kGone) break;
    std::this_thread::sleep_for(std::chrono::microseconds{100});
  }
  driver.deactivate();
  const MonotonicTime end = model_->now() + Session::kRequestMax + milliseconds{1};
  while (model_->now() < end)
    model_->advance(model_->now() + milliseconds{1});
  EXPECT_EQ(model_->effort(), 0);
}

std::vector<SerialFault> all_faults() {
  std::vector<SerialFault> faults;
  for (int i = 0; i <= static_cast<int>(test::kLastSerialFault); ++i)
    faults.push_back(static_cast<SerialFault>(i));
  return faults;
}
INSTANTIATE_TEST_SUITE_P(All, SerialDriverFaults, ::testing::ValuesIn(all_faults()),
                         [](const auto& test) { return std::string(to_string(test.param)); });

}  // namespace
}  // namespace rtpm::device_serial
