#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/base/expected.hpp"
#include "rtpm/configuration/error.hpp"
#include "rtpm/driver/calibration.hpp"
#include "rtpm/driver/descriptor.hpp"
#include "rtpm/driver/parameter.hpp"
#include "rtpm/driver/sample.hpp"

namespace rtpm::gvd {

/// The configuration manager's view of a device's server.
/// @threads  apply() and make_calibration() from one thread; the rest from any
class Configurable {
 public:
  Configurable() = default;
  Configurable(const Configurable&) = delete;
  Configurable& operator=(const Configurable&) = delete;
  virtual ~Configurable() = default;

  [[nodiscard]] virtual const driver::Descriptor& descriptor() const noexcept = 0;
  /// The driver's parameters and the server's own, constant.
  /// @realtime set-up only
  [[nodiscard]] virtual std::vector<driver::ParameterSpec> parameters() const = 0;
  /// The driver's calibrations, constant; none by default.
  /// @realtime set-up only
  [[nodiscard]] virtual std::vector<driver::CalibrationInfo> calibrations() const { return {}; }

  /// Changes all of `settings` or none between two cycles, and writes back the values that the
  /// device took over. The caller has checked them against parameters(). Waits a bounded time for
  /// the device's thread; a change that has not started by then never happens.
  /// @param needs_inactive  refuse if the device is active when its turn comes
  /// @realtime set-up only
  /// @errors   kBusy · kWrongState · kRefusedByDevice, with the driver's message
  [[nodiscard]] virtual expected<void, ConfigurationError> apply(
      std::span<driver::ParameterSetting> settings, bool needs_inactive) = 0;
  /// Creates a run of the calibration `name`, one of calibrations(), between two cycles.
  /// @realtime set-up only
  /// @errors   kBusy · kUnknownCalibration
  [[nodiscard]] virtual expected<std::unique_ptr<driver::Calibration>, ConfigurationError>
  make_calibration(std::string_view name) {
    return unexpected{ConfigurationError{
        ConfigurationOutcome::kUnknownCalibration,
        {},
        {"there is no calibration " + std::string(name), "", "set parameters instead"}}};
  }

  /// Whether the device is active, so that parameters with Mutability::kInactive can't change.
  /// @realtime alloc-free
  [[nodiscard]] virtual bool is_active() const noexcept = 0;
  /// The newest sample; nullopt before the first, and by default.
  /// @realtime alloc-free
  [[nodiscard]] virtual std::optional<driver::Sample> newest() const noexcept {
    return std::nullopt;
  }
};

/// Receives changes of parameters.
/// @threads  on_change() runs on the configuration manager's thread
class ParameterListener {
 public:
  ParameterListener() = default;
  ParameterListener(const ParameterListener&) = delete;
  ParameterListener& operator=(const ParameterListener&) = delete;
  virtual ~ParameterListener() = default;
  /// Notifies that the parameters `names` have changed; `revision` is the current one. Later
  /// requests wait until it returns.
  virtual void on_change(std::uint64_t revision, std::span<const std::string> names) = 0;
};

}  // namespace rtpm::gvd
