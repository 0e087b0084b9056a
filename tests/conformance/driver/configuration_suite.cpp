#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "driver_suite.hpp"
#include "drivers.hpp"

/// What rtpm/driver/driver.hpp promises of every driver's parameters and calibrations.
namespace rtpm::test {
namespace {

using driver::Mutability;
using driver::ParameterSetting;
using driver::ParameterSpec;
using driver::ParameterType;
using driver::ParameterValue;
using driver::ValueFault;

class DriverConfiguration : public ::testing::TestWithParam<DriverUnderTest> {
 protected:
  void SetUp() override { driver_ = GetParam().make(); }

  void start() {
    ASSERT_TRUE(driver_->configure({.period = std::chrono::milliseconds{1}}));
    ASSERT_TRUE(driver_->activate());
  }
  const driver::Sample& exchange() {
    driver::Command command;
    command.cycle_time = now_ += std::chrono::milliseconds{1};
    sample_.faults = {};
    EXPECT_EQ(driver_->exchange(command, sample_), driver::ExchangeStatus::kOk);
    return sample_;
  }
  /// Sets one parameter; checks what comes back.
  void set(const ParameterSpec& spec, const ParameterValue& value) {
    std::vector<ParameterSetting> settings{{spec.name, value}};
    const auto done = driver_->set_parameters(settings);
    if (!done) {
      EXPECT_FALSE(done.error().text().empty()) << spec.name << ": refused without words";
      return;
    }
    EXPECT_EQ(settings[0].name, spec.name);
    EXPECT_EQ(check(spec, settings[0].value), ValueFault::kNone) << spec.name;
  }
  /// Sets every parameter that may change in this state to several values, last its default.
  void try_all(bool is_active) {
    for (const ParameterSpec& spec : driver_->parameters()) {
      const bool can_change = spec.mutability == Mutability::kAnyTime ||
                              (spec.mutability == Mutability::kInactive && !is_active);
      if (!can_change) continue;
      for (const ParameterValue& value : values_of(spec)) {
        set(spec, value);
        if (is_active) exchange();
      }
    }
  }
  /// The ends of its range, or its choices, and its default.
  static std::vector<ParameterValue> values_of(const ParameterSpec& spec) {
    std::vector<ParameterValue> values;
    for (const double end : {spec.low, spec.high}) {
      if (!std::isfinite(end)) continue;
      if (spec.type == ParameterType::kReal) values.emplace_back(end);
      if (spec.type == ParameterType::kInteger) values.emplace_back(static_cast<std::int64_t>(end));
      if (spec.type == ParameterType::kVector) {
        values.emplace_back(std::vector<double>(spec.vector_size, end));
      }
    }
    for (const std::string& choice : spec.choices)
      values.emplace_back(choice);
    if (spec.type == ParameterType::kBool) values.insert(values.end(), {true, false});
    values.push_back(spec.default_value);
    return values;
  }
  /// Checks a calibration's result as the configuration manager does.
  void expect_valid(const std::vector<ParameterSetting>& settings) {
    const auto specs = driver_->parameters();
    for (const ParameterSetting& setting : settings) {
      const auto spec = std::ranges::find(specs, setting.name, &ParameterSpec::name);
      ASSERT_NE(spec, specs.end()) << setting.name;
      EXPECT_EQ(check(*spec, setting.value), ValueFault::kNone) << setting.name;
      EXPECT_NE(spec->mutability, Mutability::kReadOnly) << setting.name;
    }
  }

  std::unique_ptr<driver::Driver> driver_;
  driver::Sample sample_{};
  MonotonicTime now_{std::chrono::seconds{1000}};
};

TEST_P(DriverConfiguration, DescribesEachParameter) {
  const auto specs = driver_->parameters();
  EXPECT_LE(specs.size(), driver::kParameterCountMax);
  std::set<std::string> names;
  for (const ParameterSpec& spec : specs) {
    EXPECT_EQ(fault_of(spec), "") << spec.name;
    EXPECT_FALSE(spec.description.empty()) << spec.name;
    EXPECT_FALSE(spec.name.starts_with("safety.")) << spec.name << " is in the server's group";
    EXPECT_TRUE(names.insert(spec.name).second) << spec.name << " twice";
  }
}

TEST_P(DriverConfiguration, TakesParametersInEveryState) {
  try_all(false);
  start();
  exchange();
  try_all(true);
  driver_->deactivate();
  try_all(false);
  start();
  const driver::Vector3 position_m = exchange().pose.position_m;
  driver_ = GetParam().make();
  start();
  EXPECT_EQ(exchange().pose.position_m, position_m) << "with its defaults it is as a new one";
}

TEST_P(DriverConfiguration, CalibrationsEndWithValuesOrWords) {
  start();
  EXPECT_EQ(driver_->make_calibration("no such calibration"), nullptr);
  for (const driver::CalibrationInfo& info : driver_->calibrations()) {
    EXPECT_FALSE(info.name.empty() || info.description.empty());
    const auto calibration = driver_->make_calibration(info.name);
    ASSERT_NE(calibration, nullptr) << info.name;
    std::optional<std::string> answer;
    bool is_over = false;
    for (int i = 0; i < 10'000 && !is_over; ++i) {
      const auto state = calibration->step(exchange(), std::exchange(answer, std::nullopt));
      if (const auto* prompt = std::get_if<driver::CalibrationPrompt>(&state)) {
        ASSERT_FALSE(prompt->text.empty() || prompt->answers.empty()) << info.name;
        answer = prompt->answers.front();
      } else if (const auto* done = std::get_if<driver::CalibrationDone>(&state)) {
        is_over = true;
        EXPECT_FALSE(done->summary.empty());
        expect_valid(done->settings);
      } else if (const auto* failed = std::get_if<driver::CalibrationFailed>(&state)) {
        is_over = true;
        EXPECT_FALSE(failed->reason.empty());
      }
    }
    EXPECT_TRUE(is_over) << info.name << " does not end";
  }
}

TEST_P(DriverConfiguration, CalibrationsOutliveTheirDriver) {
  start();
  for (const driver::CalibrationInfo& info : driver_->calibrations()) {
    auto calibration = driver_->make_calibration(info.name);
    static_cast<void>(calibration->step(exchange(), std::nullopt));
    driver_ = GetParam().make();
    EXPECT_FALSE(
        std::holds_alternative<driver::CalibrationDone>(calibration->step(sample_, std::nullopt)));
    calibration.reset();
    start();
  }
}

INSTANTIATE_TEST_SUITE_P(Drivers, DriverConfiguration, ::testing::ValuesIn(drivers_under_test()),
                         [](const auto& test) { return test.param.name; });

}  // namespace
}  // namespace rtpm::test
