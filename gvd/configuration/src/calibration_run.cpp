#include "calibration_run.hpp"

#include <algorithm>
#include <utility>
#include <variant>

namespace rtpm::gvd {

std::string_view to_string(CalibrationPhase phase) noexcept {
  switch (phase) {
    case CalibrationPhase::kRunning:
      return "running";
    case CalibrationPhase::kPrompt:
      return "prompt";
    case CalibrationPhase::kDone:
      return "done";
    case CalibrationPhase::kFailed:
      return "failed";
    case CalibrationPhase::kKept:
      return "kept";
    case CalibrationPhase::kDiscarded:
      return "discarded";
  }
  return "unknown";
}

CalibrationRun::CalibrationRun(std::unique_ptr<driver::Calibration> calibration, std::string name,
                               std::uint64_t number, std::uint64_t revision, MonotonicTime now)
    : calibration_(std::move(calibration)),
      revision_(revision),
      last_sample_(now),
      last_question_(now) {
  status_.run = number;
  status_.name = std::move(name);
}

void CalibrationRun::step(const std::optional<driver::Sample>& newest, MonotonicTime now) {
  if (!is_open()) return;
  if (now - last_question_ >= kSilenceMax) {
    discard("no client asked about it for 30 s");
    return;
  }
  if (status_.phase == CalibrationPhase::kDone) return;
  const bool is_new = newest && newest->sequence != last_sequence_ &&
                      newest->lifecycle == driver::Lifecycle::kActive;
  if (is_new) {
    last_sequence_ = newest->sequence;
    last_sample_ = now;
    const std::optional<std::string> answer = std::exchange(answer_, std::nullopt);
    // A prompt after an answer is a new one, even of the same words.
    if (answer) status_.phase = CalibrationPhase::kRunning;
    take(calibration_->step(*newest, answer));
  } else if (now - last_sample_ >= kNoSampleMax) {
    take(driver::CalibrationFailed{
        "the device gave no samples for 5 s; activate it, and calibrate again"});
  }
}

void CalibrationRun::take(driver::CalibrationState state) {
  const bool was_prompt = status_.phase == CalibrationPhase::kPrompt;
  const std::string prompt_before = std::exchange(status_.text, {});
  status_.answers.clear();
  if (auto* running = std::get_if<driver::CalibrationRunning>(&state)) {
    status_.phase = CalibrationPhase::kRunning;
    status_.progress = std::clamp(running->progress, 0.0, 1.0);
  } else if (auto* prompt = std::get_if<driver::CalibrationPrompt>(&state)) {
    if (!was_prompt || prompt->text != prompt_before) ++status_.prompt;
    status_.phase = CalibrationPhase::kPrompt;
    status_.progress = std::clamp(prompt->progress, 0.0, 1.0);
    status_.text = std::move(prompt->text);
    status_.answers = std::move(prompt->answers);
  } else if (auto* done = std::get_if<driver::CalibrationDone>(&state)) {
    status_.phase = CalibrationPhase::kDone;
    status_.progress = 1;
    status_.text = std::move(done->summary);
    status_.settings = std::move(done->settings);
  } else {
    status_.phase = CalibrationPhase::kFailed;
    status_.text = std::move(std::get<driver::CalibrationFailed>(state).reason);
  }
  if (status_.phase > CalibrationPhase::kPrompt) calibration_.reset();
}

expected<void, ConfigurationError> CalibrationRun::answer(std::uint32_t prompt,
                                                          std::string_view text) {
  const auto refused = [&](std::string why, std::string remedy) {
    return unexpected{
        ConfigurationError{ConfigurationOutcome::kWrongAnswer,
                           {},
                           {"the answer was not taken", std::move(why), std::move(remedy)}}};
  };
  if (status_.phase != CalibrationPhase::kPrompt || prompt != status_.prompt || answer_) {
    return refused("the calibration does not wait for an answer to this prompt",
                   "ask for its state");
  }
  if (std::ranges::find(status_.answers, text) == status_.answers.end()) {
    std::string answers;
    for (const std::string& possible : status_.answers) {
      answers += (answers.empty() ? "" : " or ") + possible;
    }
    return refused("it is none of the possible ones", "answer " + answers);
  }
  answer_ = text;
  return {};
}

void CalibrationRun::keep(std::vector<driver::ParameterSetting> settings) {
  status_.settings = std::move(settings);
  status_.phase = CalibrationPhase::kKept;
}

void CalibrationRun::discard(std::string why) {
  status_.phase = CalibrationPhase::kDiscarded;
  status_.text = std::move(why);
  status_.answers.clear();
  status_.settings.clear();
  calibration_.reset();
}

}  // namespace rtpm::gvd
