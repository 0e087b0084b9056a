#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/configuration/calibration_status.hpp"
#include "rtpm/configuration/error.hpp"
#include "rtpm/configuration/revised_settings.hpp"
#include "rtpm/driver/calibration.hpp"
#include "rtpm/driver/parameter.hpp"
#include "rtpm/rpc/binding.hpp"
#include "rtpm/rpc/node.hpp"

namespace rtpm::gvd {

/// The name of a device's configuration: "lab/arm0/config" for "lab/arm0". A URL gets
/// the same suffix.
[[nodiscard]] inline std::string configuration_path(std::string_view device) {
  return std::string(device) + "/config";
}

/// A parameter's specification and current value.
struct Parameter {
  driver::ParameterSpec spec{};
  driver::ParameterValue value{};
};

/// A device's parameters at one moment.
/// @ownership a value
struct DeviceConfiguration {
  std::string model{};
  std::string serial{};
  std::uint64_t revision = 0;
  bool is_active = false;      ///< Parameters with Mutability::kInactive can't change.
  bool is_persistent = false;  ///< The server has a folder for save().
  bool is_unsaved = false;     ///< A value has changed since it was saved or loaded.
  std::vector<Parameter> parameters{};

  /// Null if there is no such parameter.
  [[nodiscard]] const Parameter* find(std::string_view name) const noexcept;
};

/// The calibrations that a device offers.
struct DeviceCalibrations {
  std::vector<driver::CalibrationInfo> calibrations{};
  std::uint64_t open_run = 0;  ///< The unfinished run; 0 if there is none.
};

/// Configures a configuration client.
struct ConfigurationClientOptions {
  rpc::BindOptions bind{};
  rpc::CallOptions call{};  ///< Options of all calls; by default the methods' deadlines.
};

/// The parameters and calibrations of a remote device as a local object.
///
///     auto client = ConfigurationClient::open(node, "lab/arm0");
///     const auto before = client->list();
///     const auto after = client->apply(before->revision, {{"safety.ramp_s", 0.01}});
///     if (!after) … after.error().words.text() …
///
/// All methods return ConfigurationOutcome::kCallFailed if the call got no reply: then read the
/// values before repeating a change.
/// @ownership refers to its node, which must outlive it
/// @threads  any, concurrently
/// @realtime set-up only
class ConfigurationClient {
 public:
  /// Binds the configuration of `device`, a name or a URL.
  /// @errors   those of rpc::Binding::bind()
  [[nodiscard]] static expected<ConfigurationClient, SetupError> open(
      rpc::Node& node, std::string_view device, const ConfigurationClientOptions& options = {});
  ConfigurationClient(ConfigurationClient&&) noexcept;
  ConfigurationClient& operator=(ConfigurationClient&&) noexcept;
  ~ConfigurationClient();

  [[nodiscard]] expected<DeviceConfiguration, ConfigurationError> list();
  /// Returns the values of the named parameters; of all, if no names are given.
  /// @errors   kUnknownParameter
  [[nodiscard]] expected<RevisedSettings, ConfigurationError> get(
      const std::vector<std::string>& names = {});
  /// Changes all of the parameters or none, if nothing has changed since `revision`. Returns the
  /// values that the device took over.
  /// @errors   kStaleRevision: read again · kUnknownParameter · kRepeatedParameter · kReadOnly ·
  ///           kWrongType · kOutOfRange · kWrongState · kRefusedByDevice · kBusy: repeat
  [[nodiscard]] expected<RevisedSettings, ConfigurationError> apply(
      std::uint64_t revision, const std::vector<driver::ParameterSetting>& settings);
  /// Resets the named parameters to their defaults; without names, all that may change.
  /// @errors   those of apply()
  [[nodiscard]] expected<RevisedSettings, ConfigurationError> reset(
      std::uint64_t revision, const std::vector<std::string>& names = {});
  /// Saves the values for the server's next start with this model and serial number.
  /// @errors   kNotPersistent · kStorageFailed
  [[nodiscard]] expected<void, ConfigurationError> save();

  [[nodiscard]] expected<DeviceCalibrations, ConfigurationError> calibrations();
  /// Starts a calibration. Ask calibration() for its state at least every 30 s, or it is
  /// discarded.
  /// @errors   kUnknownCalibration · kBusy: another run is unfinished
  [[nodiscard]] expected<CalibrationStatus, ConfigurationError> calibrate(std::string_view name);
  /// @errors   kNoSuchRun
  [[nodiscard]] expected<CalibrationStatus, ConfigurationError> calibration(std::uint64_t run);
  /// Answers the prompt of `status`, with one of its answers.
  /// @errors   kNoSuchRun · kWrongAnswer: not one of the answers, or the prompt has ended
  [[nodiscard]] expected<CalibrationStatus, ConfigurationError> answer(
      const CalibrationStatus& status, std::string_view text);
  /// Applies the result of a run.
  /// @errors   kNoSuchRun · kNoResult · those of apply(); kStaleRevision: parameters have changed
  ///           since its start
  [[nodiscard]] expected<CalibrationStatus, ConfigurationError> keep(std::uint64_t run);
  /// Cancels a run or discards its result; nothing changes.
  /// @errors   kNoSuchRun
  [[nodiscard]] expected<CalibrationStatus, ConfigurationError> discard(std::uint64_t run);

 private:
  struct Impl;
  explicit ConfigurationClient(std::unique_ptr<Impl> impl) noexcept;
  std::unique_ptr<Impl> impl_;
};

}  // namespace rtpm::gvd
