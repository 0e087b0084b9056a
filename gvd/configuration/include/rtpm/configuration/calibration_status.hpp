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
  kFailed = 3,     ///< Over without a result.
  kKept = 4,       ///< Over, the result was applied.
  kDiscarded = 5,  ///< Over by a client, or because no client asked about it for 30 s.
};
inline constexpr std::uint8_t kCalibrationPhaseCount = 6;
/// "running", "prompt", "done", "failed", "kept", "discarded".
[[nodiscard]] std::string_view to_string(CalibrationPhase phase) noexcept;
/// Whether a run in this phase goes on or waits, so that no other can start.
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
  /// The prompt, the result's summary, or why it failed or was discarded.
  std::string text{};
  std::vector<std::string> answers{};                ///< With kPrompt: the valid answers.
  std::vector<driver::ParameterSetting> settings{};  ///< The result, with kDone and kKept.
};

}  // namespace rtpm::gvd
