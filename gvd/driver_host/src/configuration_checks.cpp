#include <algorithm>
#include <cmath>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "driver_trial.hpp"

/// The checks of a driver's parameters and calibrations.
namespace rtpm::driver_host {
namespace {

using driver::CommandMode;
using driver::Mutability;
using driver::ParameterSetting;
using driver::ParameterSpec;
using driver::ParameterType;
using driver::ParameterValue;
using driver::ValueFault;

/// The bounds of a parameter's range, or its choices, and its default.
std::vector<ParameterValue> values_of(const ParameterSpec& spec) {
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

/// Sets one parameter, and checks the value that the driver returns.
void set(DriverTrial& trial, const ParameterSpec& spec, const ParameterValue& value) {
  std::vector<ParameterSetting> settings{{spec.name, value}};
  const auto done = trial.driver->set_parameters(settings);
  const std::string parameter = "parameter '" + spec.name + "'";
  if (!done) {
    trial.expect(!done.error().text().empty(), parameter + " is refused without words");
    return;
  }
  trial.expect(settings[0].name == spec.name, parameter + " comes back with another name");
  trial.expect(check(spec, settings[0].value) == ValueFault::kNone,
               parameter + " comes back with a value that its description does not allow");
}

/// Sets every parameter that may change in this state to several values, ending with its default.
void try_all(DriverTrial& trial, bool is_active) {
  for (const ParameterSpec& spec : trial.driver->parameters()) {
    const bool can_change = spec.mutability == Mutability::kAnyTime ||
                            (spec.mutability == Mutability::kInactive && !is_active);
    if (!can_change) continue;
    for (const ParameterValue& value : values_of(spec)) {
      set(trial, spec, value);
      if (is_active) trial.expect_ok(trial.exchange(CommandMode::kOff));
    }
  }
}

/// Checks a calibration's result as the configuration manager does.
void expect_valid(DriverTrial& trial, const std::vector<ParameterSetting>& settings) {
  const auto specs = trial.driver->parameters();
  for (const ParameterSetting& setting : settings) {
    const auto spec = std::ranges::find(specs, setting.name, &ParameterSpec::name);
    if (!trial.expect(spec != specs.end(),
                      "a calibration sets '" + setting.name + "', which is no parameter")) {
      continue;
    }
    trial.expect(check(*spec, setting.value) == ValueFault::kNone &&
                     spec->mutability != Mutability::kReadOnly,
                 "a calibration gives '" + setting.name + "' a value that it can't have");
  }
}

/// Answers a prompt, if there is one; returns whether this was the last step.
bool is_end(DriverTrial& trial, const std::string& name, const driver::CalibrationState& state,
            std::optional<std::string>& answer) {
  if (const auto* prompt = std::get_if<driver::CalibrationPrompt>(&state)) {
    const bool is_whole = !prompt->text.empty() && !prompt->answers.empty();
    if (!trial.expect(is_whole, name + " prompts without text or answers")) return true;
    answer = prompt->answers.front();
  } else if (const auto* done = std::get_if<driver::CalibrationDone>(&state)) {
    trial.expect(!done->summary.empty(), name + " ends without a summary");
    expect_valid(trial, done->settings);
    return true;
  } else if (const auto* failed = std::get_if<driver::CalibrationFailed>(&state)) {
    trial.expect(!failed->reason.empty(), name + " fails without a reason");
    return true;
  }
  return false;
}

}  // namespace

void describes_each_parameter(DriverTrial& trial) {
  const auto specs = trial.driver->parameters();
  trial.expect(specs.size() <= driver::kParameterCountMax, "there are too many parameters");
  std::set<std::string> names;
  for (const ParameterSpec& spec : specs) {
    const std::string parameter = "parameter '" + spec.name + "'";
    trial.expect(fault_of(spec).empty(), parameter + ": " + fault_of(spec));
    trial.expect(!spec.description.empty(), parameter + " has no description");
    trial.expect(!spec.name.starts_with("safety."), parameter + " is in the server's group");
    trial.expect(names.insert(spec.name).second, parameter + " is there twice");
  }
}

void takes_parameters_in_every_state(DriverTrial& trial) {
  try_all(trial, false);
  if (!trial.start()) return;
  trial.expect_ok(trial.exchange(CommandMode::kOff));
  try_all(trial, true);
  trial.driver->deactivate();
  try_all(trial, false);
  if (!trial.start() || !trial.expect_ok(trial.exchange(CommandMode::kOff))) return;
  if (!trial.is_simulated()) return;
  const driver::Vector3 position_m = trial.sample.pose.position_m;
  if (!trial.renew() || !trial.start()) return;
  trial.expect_ok(trial.exchange(CommandMode::kOff));
  trial.expect(trial.sample.pose.position_m == position_m,
               "with its defaults set it is elsewhere than a new one");
}

void calibrations_end_with_values_or_words(DriverTrial& trial) {
  if (!trial.start()) return;
  trial.expect(trial.driver->make_calibration("no such calibration") == nullptr,
               "make_calibration() makes one that is not listed");
  for (const driver::CalibrationInfo& info : trial.driver->calibrations()) {
    const std::string name = "calibration '" + info.name + "'";
    trial.expect(!info.name.empty() && !info.description.empty(), name + " has no description");
    const auto calibration = trial.driver->make_calibration(info.name);
    if (!trial.expect(calibration != nullptr, name + " is listed, but not made")) continue;
    std::optional<std::string> answer;
    bool is_over = false;
    for (int i = 0; i < 10'000 && !is_over; ++i) {
      if (!trial.expect_ok(trial.exchange(CommandMode::kOff))) return;
      is_over =
          is_end(trial, name, calibration->step(trial.sample, std::exchange(answer, std::nullopt)),
                 answer);
    }
    trial.expect(is_over, name + " does not end within 10 000 samples");
  }
}

void calibrations_outlive_their_driver(DriverTrial& trial) {
  if (!trial.start()) return;
  for (const driver::CalibrationInfo& info : trial.driver->calibrations()) {
    auto calibration = trial.driver->make_calibration(info.name);
    if (calibration == nullptr) continue;
    trial.expect_ok(trial.exchange(CommandMode::kOff));
    static_cast<void>(calibration->step(trial.sample, std::nullopt));
    if (!trial.renew()) return;
    trial.expect(!std::holds_alternative<driver::CalibrationDone>(
                     calibration->step(trial.sample, std::nullopt)),
                 "calibration '" + info.name + "' is done without its driver");
    calibration.reset();
    if (!trial.start()) return;
  }
}

}  // namespace rtpm::driver_host
