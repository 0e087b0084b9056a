#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "rtpm/driver/parameter.hpp"
#include "rtpm/driver/sample.hpp"

namespace rtpm::driver {

/// A calibration that a device offers.
struct CalibrationInfo {
  std::string name;         ///< Follows the rules of a parameter's name: "encoder_offset".
  std::string description;  ///< One sentence: the result, and the operator's task.
};

/// The run needs further samples.
struct CalibrationRunning {
  double progress = 0;  ///< 0 to 1, of the whole calibration.
};

/// The run waits for an answer. Samples keep arriving, and may end the prompt.
struct CalibrationPrompt {
  double progress = 0;
  std::string text;                    ///< The operator's task, one sentence.
  std::vector<std::string> answers{};  ///< The valid answers, at least one: "ready", "skip".
};

/// The run has ended with a result, which a client keeps or discards.
struct CalibrationDone {
  std::vector<ParameterSetting> settings{};  ///< Values of the device's parameters.
  std::string summary{};  ///< One sentence for the operator: "the offset is (1, 0, 2) mm ± 0.1 mm".
};

/// The run has ended without a result.
struct CalibrationFailed {
  std::string reason;  ///< Cause and remedy as a clause: "the arm moved; leave it at rest".
};

using CalibrationState =
    std::variant<CalibrationRunning, CalibrationPrompt, CalibrationDone, CalibrationFailed>;

/// One run of a calibration: a state machine without clock, thread or hardware. It receives samples
/// and answers, and ends with parameter values or a reason. It changes nothing itself.
/// @ownership must not refer to its driver: it copies what it needs when it is created
/// @threads  one at a time; never the device's thread
class Calibration {
 public:
  Calibration() = default;
  Calibration(const Calibration&) = delete;
  Calibration& operator=(const Calibration&) = delete;
  virtual ~Calibration() = default;

  /// Handles a sample of the active device, with the answer if one arrived for the current prompt.
  /// Samples are in order, but some cycles are left out: use Sample::sequence and host_time to
  /// measure gaps. The first call has no answer. Not called again after CalibrationDone or
  /// CalibrationFailed.
  /// @param answer  one of the current prompt's answers
  /// @realtime set-up only
  [[nodiscard]] virtual CalibrationState step(const Sample& sample,
                                              std::optional<std::string_view> answer) = 0;
};

}  // namespace rtpm::driver
