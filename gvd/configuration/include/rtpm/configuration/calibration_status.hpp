#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/driver/parameter.hpp"

namespace rtpm::gvd {

/// Phase of a calibration's run; wire numbers.
enum class CalibrationPhase : std::uint8_t {
  kRunning = 0,    ///< It takes samples.
  kPrompt = 1,     ///< It waits for an answer.
  kDone = 2,       ///< It has a result to keep or discard.
  kFailed = 3,     ///< Ended without a result.
  kKept = 4,       ///< Ended; the result was applied.
  kDiscarded = 5,  ///< Discarded by a client, or after 30 s without a query.
};
inline constexpr std::uint8_t kCalibrationPhaseCount = 6;
/// "running", "prompt", "done", "failed", "kept", "discarded".
[[nodiscard]] std::string_view to_string(CalibrationPhase phase) noexcept;
/// Whether a run in this phase is unfinished, so that no other can start.
[[nodiscard]] constexpr bool is_open(CalibrationPhase phase) noexcept {
  return phase <= CalibrationPhase::kDone;
}

/// State of a calibration's run.
/// @ownership a value
struct CalibrationStatus {
  std::uint64_t run = 0;
  std::string name{};
  CalibrationPhase phase = CalibrationPhase::kRunning;
  double progress = 0;       ///< 0 to 1.
  std::uint32_t prompt = 0;  ///< With kPrompt: counts the run's prompts from 1.
  /// The prompt, the result's summary, or the reason for a failure or discard.
  std::string text{};
  std::vector<std::string> answers{};                ///< With kPrompt: the valid answers.
  std::vector<driver::ParameterSetting> settings{};  ///< The result, with kDone and kKept.
};

}  // namespace rtpm::gvd
