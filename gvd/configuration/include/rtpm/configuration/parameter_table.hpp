#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/base/expected.hpp"
#include "rtpm/base/setup_error.hpp"
#include "rtpm/configuration/error.hpp"
#include "rtpm/driver/parameter.hpp"

namespace rtpm::gvd {

/// A device's parameters with their values and revision, and the checks of a change. Uses no
/// device, thread or clock.
/// @ownership a value
/// @threads  one at a time
/// @realtime set-up only
class ParameterTable {
 public:
  /// A table of `specs` with their defaults as values.
  /// @errors   an invalid specification, a repeated name, more than driver::kParameterCountMax
  [[nodiscard]] static expected<ParameterTable, SetupError> create(
      std::vector<driver::ParameterSpec> specs, std::uint64_t first_revision = 1);

  [[nodiscard]] const std::vector<driver::ParameterSpec>& specs() const noexcept { return specs_; }
  /// Values, in the order of specs().
  [[nodiscard]] const std::vector<driver::ParameterValue>& values() const noexcept {
    return values_;
  }
  /// Increases with each change of a value.
  [[nodiscard]] std::uint64_t revision() const noexcept { return revision_; }

  /// Values by name; all values if no names are given.
  /// @errors   kUnknownParameter
  [[nodiscard]] expected<std::vector<driver::ParameterSetting>, ConfigurationError> settings(
      std::span<const std::string> names = {}) const;
  /// The settings that differ from their defaults.
  [[nodiscard]] std::vector<driver::ParameterSetting> changed_settings() const;
  /// Returns the settings that reset the named parameters: the defaults of those that differ.
  /// Without names, resets all parameters that a client may change.
  /// @errors   kUnknownParameter
  [[nodiscard]] expected<std::vector<driver::ParameterSetting>, ConfigurationError> reset(
      std::span<const std::string> names) const;

  /// Whether `revision` is the current one.
  /// @errors   kStaleRevision
  [[nodiscard]] expected<void, ConfigurationError> check_revision(std::uint64_t revision) const;
  /// Whether every one of `settings` may be applied in this state.
  /// @errors   kUnknownParameter, kRepeatedParameter, kReadOnly, kWrongType, kOutOfRange,
  ///           kWrongState, for the first that may not
  [[nodiscard]] expected<void, ConfigurationError> check(
      std::span<const driver::ParameterSetting> settings, bool is_active) const;
  /// Whether one of `settings`, which check() accepts, needs an inactive device.
  [[nodiscard]] bool needs_inactive(std::span<const driver::ParameterSetting> settings) const;
  /// Stores the values that the device took over; returns the names of the changed parameters.
  std::vector<std::string> commit(std::span<const driver::ParameterSetting> applied);

 private:
  ParameterTable(std::vector<driver::ParameterSpec> specs, std::uint64_t first_revision);
  [[nodiscard]] std::size_t index_of(std::string_view name) const noexcept;
  [[nodiscard]] ConfigurationError unknown(const std::string& name) const;

  std::vector<driver::ParameterSpec> specs_;
  std::vector<driver::ParameterValue> values_{};
  std::uint64_t revision_;
};

}  // namespace rtpm::gvd
