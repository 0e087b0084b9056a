#include "configurable_device.hpp"

#include <algorithm>
#include <string>
#include <utility>

#include "rtpm/safety/parameters.hpp"

namespace rtpm::gvd {
namespace {

using driver::ParameterSetting;

unexpected<ConfigurationError> refused(ConfigurationOutcome outcome, SetupError words) {
  return {{outcome, {}, std::move(words)}};
}

unexpected<ConfigurationError> busy() {
  return refused(
      ConfigurationOutcome::kBusy,
      {"nothing was changed", "the device's thread had no time for it within 100 ms", "try again"});
}

bool is_of_server(const ParameterSetting& setting) noexcept {
  return setting.name.starts_with(kSafetyGroup);
}

}  // namespace

ConfigurableDevice::ConfigurableDevice(driver::Driver& driver, const driver::Descriptor& descriptor,
                                       DeviceCycle& cycle)
    : driver_(driver),
      descriptor_(descriptor),
      cycle_(cycle),
      parameters_(driver.parameters()),
      calibrations_(driver.calibrations()) {
  std::ranges::move(safety_parameters(cycle.safety()), std::back_inserter(parameters_));
}

expected<void, ConfigurationError> ConfigurableDevice::apply(std::span<ParameterSetting> settings,
                                                             bool needs_inactive) {
  expected<void, ConfigurationError> outcome;
  const bool is_done = cycle_.jobs().perform([&] { outcome = change(settings, needs_inactive); });
  return is_done ? outcome : busy();
}

expected<void, ConfigurationError> ConfigurableDevice::change(std::span<ParameterSetting> settings,
                                                              bool needs_inactive) {
  if (needs_inactive && is_active()) {
    return refused(ConfigurationOutcome::kWrongState,
                   {"nothing was changed", "the device is active", "deactivate the device first"});
  }
  std::vector<ParameterSetting> of_driver;
  std::vector<ParameterSetting> of_server;
  for (const ParameterSetting& setting : settings) {
    (is_of_server(setting) ? of_server : of_driver).push_back(setting);
  }
  if (!of_driver.empty()) {
    if (auto set = driver_.set_parameters(of_driver); !set) {
      return refused(ConfigurationOutcome::kRefusedByDevice, std::move(set.error()));
    }
  }
  // Setting the server's own parameters can't fail: their ranges were checked.
  cycle_.set_present_safety(with_settings(cycle_.present_safety(), of_server));
  for (ParameterSetting& setting : settings) {
    const auto taken = std::ranges::find(of_driver, setting.name, &ParameterSetting::name);
    if (taken != of_driver.end()) setting.value = std::move(taken->value);
  }
  return {};
}

expected<std::unique_ptr<driver::Calibration>, ConfigurationError>
ConfigurableDevice::make_calibration(std::string_view name) {
  std::unique_ptr<driver::Calibration> calibration;
  if (!cycle_.jobs().perform([&] { calibration = driver_.make_calibration(name); })) return busy();
  if (calibration != nullptr) return calibration;
  return refused(
      ConfigurationOutcome::kUnknownCalibration,
      {"the device has no calibration " + std::string(name), "", "list its calibrations"});
}

}  // namespace rtpm::gvd
