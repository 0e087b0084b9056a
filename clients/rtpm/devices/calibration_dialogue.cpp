#include "devices/calibration_dialogue.hpp"

#include <algorithm>
#include <cstdio>
#include <utility>

#include "devices/parameters.hpp"
#include "rtpm/base/printable.hpp"

namespace rtpm::tool {
namespace {

using gvd::CalibrationPhase;
using gvd::CalibrationStatus;

/// The interval at which the run's state is polled; the server discards a run after 30 s without a
/// poll.
constexpr Duration kPollInterval = std::chrono::milliseconds{50};
constexpr int kProgressStepPercent = 10;

std::string choice_of(const std::vector<std::string>& answers) {
  std::string text;
  for (const std::string& answer : answers)
    text += (text.empty() ? "" : " | ") + printable(answer);
  return text;
}

std::string trimmed(const std::string& text) {
  const std::size_t begin = text.find_first_not_of(" \t\r");
  if (begin == std::string::npos) return {};
  return text.substr(begin, text.find_last_not_of(" \t\r") - begin + 1);
}

void print(const std::string& text) {
  std::fputs(text.c_str(), stdout);
  std::fflush(stdout);
}

}  // namespace

int CalibrationDialogue::run(const std::string& name) {
  auto status = client_.calibrate(name);
  if (!status) return fail(status.error().words.text());
  while (true) {
    if (stop_.is_requested()) return give_up(*status, "it was cancelled");
    if (const Next code = go_on(*status)) return *code;
    auto next = client_.calibration(status->run);
    if (!next) return give_up(*status, next.error().words.text());
    status = std::move(next);
  }
}

CalibrationDialogue::Next CalibrationDialogue::go_on(const CalibrationStatus& status) {
  switch (status.phase) {
    case CalibrationPhase::kRunning:
      show_progress(status.progress);
      static_cast<void>(stop_.wait_for(kPollInterval));
      return std::nullopt;
    case CalibrationPhase::kPrompt:
      return answer_prompt(status);
    case CalibrationPhase::kDone:
      return end(status);
    case CalibrationPhase::kFailed:
      return fail("the calibration failed, nothing has changed: " + status.text);
    case CalibrationPhase::kKept:
    case CalibrationPhase::kDiscarded:
      break;
  }
  return fail("the calibration was " + std::string(to_string(status.phase)) +
              " without this client: " + status.text);
}

CalibrationDialogue::Next CalibrationDialogue::answer_prompt(const CalibrationStatus& status) {
  if (answered_prompt_ == status.prompt) {
    // The device receives the answer with its next sample.
    static_cast<void>(stop_.wait_for(kPollInterval));
    return std::nullopt;
  }
  if (std::exchange(shown_prompt_, status.prompt) != status.prompt) {
    print(printable(status.text) + " [" + choice_of(status.answers) + "] ");
  }
  std::string line;
  if (!options_.answers.empty()) {
    line = options_.answers[std::min(answer_count_++, options_.answers.size() - 1)];
    print(printable(line) + "\n");
    return answer(status, line);
  }
  switch (input_.read_for(kPollInterval, line)) {
    case program::LineReader::Outcome::kNone:
      return std::nullopt;
    case program::LineReader::Outcome::kEnd:
      return give_up(status, "standard input ended before the calibration; give --answer");
    case program::LineReader::Outcome::kLine:
      break;
  }
  line = trimmed(line);
  if (line.empty() && status.answers.size() == 1) line = status.answers.front();
  if (std::ranges::find(status.answers, line) != status.answers.end()) return answer(status, line);
  print("Answer " + choice_of(status.answers) + ", or end with Ctrl-C: ");
  return std::nullopt;
}

CalibrationDialogue::Next CalibrationDialogue::answer(const CalibrationStatus& status,
                                                      const std::string& text) {
  answered_prompt_ = status.prompt;
  const auto taken = client_.answer(status, text);
  if (!taken) return give_up(status, taken.error().words.text());
  return std::nullopt;
}

CalibrationDialogue::Next CalibrationDialogue::end(const CalibrationStatus& status) {
  if (!std::exchange(is_asked_, true)) {
    print(printable(status.text) + "\n" + lines_of(status.settings));
    if (options_.keeps) return keep(status);
    if (options_.discards) return discard(status);
    print("Keep the result? [keep | discard] ");
  }
  std::string line;
  switch (input_.read_for(kPollInterval, line)) {
    case program::LineReader::Outcome::kNone:
      return std::nullopt;
    case program::LineReader::Outcome::kEnd:
      return give_up(status, "standard input ended before the calibration; give --keep");
    case program::LineReader::Outcome::kLine:
      break;
  }
  line = trimmed(line);
  if (line == "keep") return keep(status);
  if (line == "discard") return discard(status);
  print("Answer keep | discard: ");
  return std::nullopt;
}

int CalibrationDialogue::keep(const CalibrationStatus& status) {
  const auto kept = client_.keep(status.run);
  if (!kept) return give_up(status, kept.error().words.text());
  print("kept; 'rtpm config save' makes it last\n");
  return 0;
}

int CalibrationDialogue::discard(const CalibrationStatus& status) {
  const auto discarded = client_.discard(status.run);
  if (!discarded) return fail(discarded.error().words.text());
  print("discarded; nothing has changed\n");
  return 0;
}

int CalibrationDialogue::give_up(const CalibrationStatus& status, const std::string& why) {
  print("\n");
  // If this fails, too, the server discards the run after 30 s.
  const bool is_discarded = client_.discard(status.run).has_value();
  return fail("the calibration has no result" +
              std::string(is_discarded ? ", nothing has changed: " : ": ") + why);
}

int CalibrationDialogue::fail(const std::string& text) const {
  return context_.fail(device_ + ": " + text);
}

void CalibrationDialogue::show_progress(double progress) {
  const int percent = static_cast<int>(100 * progress);
  if (percent < shown_percent_ + kProgressStepPercent) return;
  shown_percent_ = percent - percent % kProgressStepPercent;
  print(std::to_string(shown_percent_) + " %\n");
}

}  // namespace rtpm::tool
