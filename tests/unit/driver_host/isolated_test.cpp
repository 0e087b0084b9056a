#include "rtpm/driver_host/isolated.hpp"

#include <gtest/gtest.h>
#include <signal.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <thread>
#include <vector>

#include "archive.hpp"
#include "rtpm/rt/clock.hpp"

/// A driver in its own process: the plug-in puppet.
namespace rtpm::driver_host {
namespace {

using driver::Command;
using driver::CommandMode;
using driver::ExchangeStatus;
using driver::Sample;

constexpr float kCrash = 1;
constexpr float kHang = 2;
constexpr float kAbort = 3;
constexpr Duration kLong = std::chrono::seconds{30};

class Isolated : public testing::Test, public IsolationListener {
 protected:
  void SetUp() override {
    const std::string test = testing::UnitTest::GetInstance()->current_test_info()->name();
    file_ = testing::TempDir() + "rtpm_puppet_" + test;
    std::filesystem::remove(file_);
  }
  void TearDown() override { std::filesystem::remove(file_); }
  void report(std::string_view text) override { reports_.emplace_back(text); }

  [[nodiscard]] IsolationConfig config(std::optional<Duration> patience = kLong) {
    return {.command = {RTPM_DRIVER_PROCESS, RTPM_PLUGIN_FOLDER "/puppet.so", file_},
            .exchange_patience = patience,
            .listener = this};
  }
  void begin(IsolationConfig config) {
    auto made = isolate(std::move(config));
    ASSERT_TRUE(made) << made.error().text();
    driver_ = std::move(*made);
    start();
  }
  void start() {
    const auto configured = driver_->configure({.period = std::chrono::milliseconds{1}});
    ASSERT_TRUE(configured) << configured.error().text();
    const auto activated = driver_->activate();
    ASSERT_TRUE(activated) << activated.error().text();
  }
  ExchangeStatus exchange(float told = 0) {
    Command command;
    command.mode = CommandMode::kOutputs;
    command.outputs[0] = told;
    command.cycle_time = rt::now();
    return driver_->exchange(command, sample_);
  }
  [[nodiscard]] std::string written() const {
    std::ifstream file(file_);
    return {std::istreambuf_iterator<char>(file), {}};
  }
  /// Waits until the driver has written `words`.
  void expect_written(const std::string& words) const {
    const auto give_up = std::chrono::steady_clock::now() + kLong;
    while (written().find(words) == std::string::npos &&
           std::chrono::steady_clock::now() < give_up) {
      std::this_thread::yield();
    }
    EXPECT_NE(written().find(words), std::string::npos) << written();
  }

  std::string file_{};
  std::vector<std::string> reports_{};
  std::unique_ptr<driver::Driver> driver_{};
  Sample sample_{};
};

TEST_F(Isolated, IsADriverLikeAnyOther) {
  begin(config());
  EXPECT_EQ(driver_->describe().model, "puppet");
  EXPECT_EQ(driver_->describe().axes.at(0).name, "x");
  EXPECT_EQ(driver_->describe().limits.force_newton_max, 4);
  for (int i = 1; i <= 100; ++i) {
    ASSERT_EQ(exchange(), ExchangeStatus::kOk);
    ASSERT_EQ(sample_.button_edges[0], i);
  }
  EXPECT_EQ(sample_.analogs[0], 1);
  std::vector<driver::ParameterSetting> settings{{.name = "gain", .value = 2.5}};
  ASSERT_TRUE(driver_->set_parameters(settings));
  EXPECT_EQ(settings[0].value, driver::ParameterValue(2.0)) << "as the device has taken it";
  EXPECT_EQ(exchange(), ExchangeStatus::kOk);
  EXPECT_EQ(sample_.analogs[0], 2);
  driver_->deactivate();
  EXPECT_EQ(exchange(), ExchangeStatus::kGone);
  EXPECT_TRUE(reports_.empty());
}

TEST_F(Isolated, PassesErrorsOn) {
  auto command = config();
  command.command.back() = "error";
  const auto made = isolate(command);
  ASSERT_FALSE(made);
  EXPECT_EQ(made.error().text(), "no puppet: it broke. Remedy: buy one.");
  auto whole = isolate(config());
  ASSERT_TRUE(whole);
  const auto configured = (*whole)->configure({.period = Duration{0}});
  ASSERT_FALSE(configured);
  EXPECT_EQ(configured.error().text(), "no period: it is zero. Remedy: set one.");
  command.command.front() = "/nowhere/program";
  EXPECT_FALSE(isolate(command));
}

TEST_F(Isolated, FailsIfItCrashesAtItsStart) {
  auto command = config();
  command.command.back() = "crash";
  const auto made = isolate(command);
  ASSERT_FALSE(made);
  EXPECT_NE(made.error().text().find("signal 6 (Aborted)"), std::string::npos)
      << made.error().text();
}

TEST_F(Isolated, IsGoneWhenItCrashesAndComesBack) {
  begin(config());
  std::vector<driver::ParameterSetting> settings{{.name = "gain", .value = 4.0}};
  ASSERT_TRUE(driver_->set_parameters(settings));
  for (const float fault : {kCrash, kAbort}) {
    reports_.clear();
    ASSERT_EQ(exchange(), ExchangeStatus::kOk);
    const Sample before = sample_;
    // A process that is still ending reports late first.
    ExchangeStatus status = exchange(fault);
    while (status == ExchangeStatus::kLate)
      status = exchange();
    ASSERT_EQ(status, ExchangeStatus::kGone);
    EXPECT_EQ(sample_.button_edges[0], before.button_edges[0]) << "the sample is as it was";
    driver_->deactivate();
    ASSERT_EQ(reports_.size(), 1u);
    const std::string signal = fault == kCrash ? "signal 11 (Segmentation fault)" : "signal 6";
    EXPECT_NE(reports_[0].find("exchange()"), std::string::npos) << reports_[0];
    EXPECT_NE(reports_[0].find(signal), std::string::npos) << reports_[0];
    EXPECT_TRUE(written().ends_with("configured\ndeactivated\n"))
        << "a new process makes the device safe at once: " << written();
    start();
    ASSERT_EQ(exchange(), ExchangeStatus::kOk);
    EXPECT_EQ(sample_.button_edges[0], before.button_edges[0] + 1) << "counters go on";
    EXPECT_EQ(sample_.analogs[0], 4) << "and parameters stay";
  }
}

TEST_F(Isolated, IsLateThenKilledWhenItHangs) {
  begin(config(std::chrono::milliseconds{20}));
  EXPECT_EQ(exchange(kHang), ExchangeStatus::kLate);
  EXPECT_EQ(exchange(), ExchangeStatus::kLate);
  driver_->deactivate();
  ASSERT_EQ(reports_.size(), 1u);
  EXPECT_NE(reports_[0].find("did not answer and was killed"), std::string::npos) << reports_[0];
  driver_.reset();
  begin(config());
  EXPECT_EQ(exchange(), ExchangeStatus::kOk);
}

TEST_F(Isolated, TakesTheForceAwayWithoutANewerCommand) {
  begin(config());
  Command command;
  command.mode = CommandMode::kForce;
  command.wrench.force_newton.x = 1;
  command.cycle_time = rt::now();
  command.deadline = command.cycle_time + std::chrono::milliseconds{20};
  ASSERT_EQ(driver_->exchange(command, sample_), ExchangeStatus::kOk);
  expect_written("force\noff\n");
  ASSERT_EQ(exchange(), ExchangeStatus::kOk) << "and goes on when the next one comes";
}

TEST_F(Isolated, EndsInOrderWithItsDriver) {
  begin(config());
  ASSERT_EQ(exchange(), ExchangeStatus::kOk);
  driver_.reset();
  expect_written("deactivated\ndestroyed\n");
}

TEST_F(Isolated, CalibratesInItsProcess) {
  begin(config());
  EXPECT_EQ(driver_->make_calibration("one"), nullptr);
  const auto calibration = driver_->make_calibration("zero");
  ASSERT_NE(calibration, nullptr);
  Sample sample;
  sample.sequence = 77;
  const auto prompt = calibration->step(sample, std::nullopt);
  ASSERT_TRUE(std::holds_alternative<driver::CalibrationPrompt>(prompt));
  EXPECT_EQ(std::get<driver::CalibrationPrompt>(prompt).answers.at(0), "ready");
  driver_.reset();
  const auto done = calibration->step(sample, "ready");
  ASSERT_TRUE(std::holds_alternative<driver::CalibrationDone>(done)) << "it outlives its driver";
  EXPECT_EQ(std::get<driver::CalibrationDone>(done).summary, "at 77");
  EXPECT_EQ(std::get<driver::CalibrationDone>(done).settings.at(0).value,
            driver::ParameterValue(3.0));
}

TEST_F(Isolated, ACalibrationFailsWithItsProcess) {
  begin(config());
  const auto calibration = driver_->make_calibration("zero");
  ASSERT_NE(calibration, nullptr);
  const auto state = calibration->step({}, "crash");
  ASSERT_TRUE(std::holds_alternative<driver::CalibrationFailed>(state));
}

/// A corrupted process may send anything.
TEST(IsolatedArchive, RefusesForeignBytes) {
  driver::Descriptor descriptor;
  descriptor.model = "m";
  descriptor.axes = {{.name = "x"}};
  descriptor.modes = {CommandMode::kForce};
  Writer write;
  write(descriptor, std::vector<driver::ParameterSpec>{{.name = "p", .default_value = "text"}});
  const std::vector<std::byte>& whole = write.bytes();
  const auto is_taken = [](ConstBytes bytes) {
    driver::Descriptor taken;
    std::vector<driver::ParameterSpec> parameters;
    Reader read(bytes);
    read(taken, parameters);
    return read.is_whole();
  };
  EXPECT_TRUE(is_taken(whole));
  for (std::size_t size = 0; size < whole.size(); ++size)
    EXPECT_FALSE(is_taken(ConstBytes(whole).first(size))) << size;
  for (std::size_t at = 0; at < whole.size(); ++at) {
    for (const int value : {0, 1, 0x7f, 0xff}) {
      std::vector<std::byte> changed = whole;
      changed[at] = static_cast<std::byte>(value);
      static_cast<void>(is_taken(changed));  // The archive rejects it, or it differs.
    }
  }
  std::vector<std::byte> other_class = whole;
  other_class[0] = std::byte{driver::kDeviceClassCount};
  EXPECT_FALSE(is_taken(other_class));
}

}  // namespace
}  // namespace rtpm::driver_host
