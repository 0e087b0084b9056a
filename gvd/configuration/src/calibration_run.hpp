#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/base/expected.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/configuration/calibration_status.hpp"
#include "rtpm/configuration/error.hpp"
#include "rtpm/driver/calibration.hpp"

namespace rtpm::gvd {

/// One run of a calibration, from its start until its result is kept or discarded; no clock.
/// @threads  one at a time
/// @realtime set-up only
class CalibrationRun {
 public:
  /// Time without a query from a client after which a run ends.
  static constexpr Duration kSilenceMax = std::chrono::seconds{30};
  /// Time without an active device after which a run ends.
  static constexpr Duration kNoSampleMax = std::chrono::seconds{5};

  /// @param revision  the revision of the parameters that the calibration is based on
  CalibrationRun(std::unique_ptr<driver::Calibration> calibration, std::string name,
                 std::uint64_t number, std::uint64_t revision, MonotonicTime now);

  [[nodiscard]] const CalibrationStatus& status() const noexcept { return status_; }
  [[nodiscard]] std::uint64_t revision() const noexcept { return revision_; }
  [[nodiscard]] bool is_open() const noexcept { return gvd::is_open(status_.phase); }

  /// Takes the newest sample, if it is new and the device is active. Ends a run that has waited for
  /// too long.
  void step(const std::optional<driver::Sample>& newest, MonotonicTime now);
  /// Notes that a client has asked about the run.
  void note_question(MonotonicTime now) noexcept { last_question_ = now; }
  /// Stores the answer to prompt number `prompt` for the next sample.
  /// @errors   kWrongAnswer
  [[nodiscard]] expected<void, ConfigurationError> answer(std::uint32_t prompt,
                                                          std::string_view text);
  /// Ends the run; its result was applied as `settings`.
  void keep(std::vector<driver::ParameterSetting> settings);
  /// Ends the run.
  void discard(std::string why);

 private:
  void take(driver::CalibrationState state);

  std::unique_ptr<driver::Calibration> calibration_;
  CalibrationStatus status_{};
  std::uint64_t revision_;
  std::optional<std::string> answer_{};
  std::uint64_t last_sequence_ = 0;
  MonotonicTime last_sample_;
  MonotonicTime last_question_;
};

}  // namespace rtpm::gvd
