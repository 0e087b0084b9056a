#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "calibration_run.hpp"
#include "rtpm/base/expected.hpp"
#include "rtpm/base/setup_error.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/configuration/configurable.hpp"
#include "rtpm/configuration/error.hpp"
#include "rtpm/configuration/parameter_table.hpp"
#include "rtpm/configuration/revised_settings.hpp"
#include "rtpm/configuration/settings_store.hpp"
#include "rtpm/driver/calibration.hpp"
#include "rtpm/rt/pi_mutex.hpp"

namespace rtpm::gvd {

/// A device's whole configuration at one moment.
struct ConfigurationSnapshot {
  std::uint64_t revision = 0;
  bool is_persistent = false;
  bool is_unsaved = false;
  std::vector<driver::ParameterValue> values{};  ///< In the order of specs().
};

/// The configuration manager without thread and clock: transactions over the table, the device and
/// the store, and the run of a calibration.
/// @ownership refers to device and listener, which must outlive it
/// @threads  specs(), snapshot(), settings(), revision() from any; the rest from one
/// @realtime set-up only
class Configurator {
 public:
  Configurator(Configurable& device, ParameterTable table, std::optional<SettingsStore> store,
               ParameterListener* listener);

  [[nodiscard]] const driver::Descriptor& descriptor() const noexcept {
    return device_.descriptor();
  }
  [[nodiscard]] bool is_active() const noexcept { return device_.is_active(); }
  [[nodiscard]] const std::vector<driver::ParameterSpec>& specs() const noexcept {
    return table_.specs();
  }
  [[nodiscard]] ConfigurationSnapshot snapshot() const;
  [[nodiscard]] std::uint64_t revision() const;
  /// @errors   kUnknownParameter
  [[nodiscard]] expected<RevisedSettings, ConfigurationError> settings(
      std::span<const std::string> names) const;

  /// Loads the saved settings and applies them; returns one sentence for each ignored setting.
  /// @errors   those of SettingsStore::load(); the device refuses
  [[nodiscard]] expected<std::vector<std::string>, SetupError> load();
  /// Applies `settings` to the device; returns the values that it took over.
  /// @errors   those of ParameterTable::check_revision() and check(), and Configurable::apply()
  [[nodiscard]] expected<RevisedSettings, ConfigurationError> apply(
      std::uint64_t revision, std::vector<driver::ParameterSetting> settings);
  /// Resets parameters to their defaults; all of them if no names are given.
  /// @errors   those of apply()
  [[nodiscard]] expected<RevisedSettings, ConfigurationError> reset(
      std::uint64_t revision, std::span<const std::string> names);
  /// @errors   kNotPersistent · kStorageFailed
  [[nodiscard]] expected<void, ConfigurationError> save();

  [[nodiscard]] const std::vector<driver::CalibrationInfo>& calibrations() const noexcept {
    return calibrations_;
  }
  /// The unfinished run; 0 if there is none.
  [[nodiscard]] std::uint64_t open_run() const noexcept;
  /// Starts a run, and feeds it the first sample, if there is one.
  /// @errors   kUnknownCalibration · kBusy
  [[nodiscard]] expected<CalibrationStatus, ConfigurationError> calibrate(const std::string& name,
                                                                          MonotonicTime now);
  /// @errors   kNoSuchRun
  [[nodiscard]] expected<CalibrationStatus, ConfigurationError> calibration(std::uint64_t run,
                                                                            MonotonicTime now);
  /// @errors   kNoSuchRun · kWrongAnswer
  [[nodiscard]] expected<CalibrationStatus, ConfigurationError> answer(std::uint64_t run,
                                                                       std::uint32_t prompt,
                                                                       std::string_view text,
                                                                       MonotonicTime now);
  /// Applies the result. A refused result is kept, and may be applied or discarded later.
  /// @errors   kNoSuchRun · kNoResult · those of apply()
  [[nodiscard]] expected<CalibrationStatus, ConfigurationError> keep(std::uint64_t run,
                                                                     MonotonicTime now);
  /// @errors   kNoSuchRun
  [[nodiscard]] expected<CalibrationStatus, ConfigurationError> discard(std::uint64_t run,
                                                                        MonotonicTime now);
  /// Advances the unfinished run.
  void step(MonotonicTime now);

 private:
  [[nodiscard]] expected<CalibrationRun*, ConfigurationError> find_run(std::uint64_t run,
                                                                       MonotonicTime now);

  Configurable& device_;
  /// Guards table_ and is_unsaved_ against reading threads; only one thread changes them.
  mutable rt::PiMutex mutex_{};
  ParameterTable table_;
  bool is_unsaved_ = false;
  std::optional<SettingsStore> store_;
  ParameterListener* listener_;
  std::vector<driver::CalibrationInfo> calibrations_;
  std::optional<CalibrationRun> run_{};
  std::uint64_t run_count_ = 0;
};

}  // namespace rtpm::gvd
