#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "cli/context.hpp"
#include "rtpm/configuration/client.hpp"
#include "rtpm/program/line_reader.hpp"

namespace rtpm::tool {

/// The decisions that an operator may make in advance.
struct DialogueOptions {
  std::vector<std::string> answers{};  ///< Answers to the prompts; the last one repeats.
  bool keeps = false;                  ///< Keeps the result without asking.
  bool discards = false;               ///< Discards the result without asking.
};

/// Conducts a calibration with an operator: prints prompts, progress and result, and reads answers
/// from the options, then from standard input. Discards a run that it abandons.
/// @ownership refers to its arguments
/// @threads  one
class CalibrationDialogue {
 public:
  CalibrationDialogue(gvd::ConfigurationClient& client, Context& context, const std::string& device,
                      const DialogueOptions& options)
      : client_(client),
        context_(context),
        device_(device),
        options_(options),
        stop_(context.stop()) {}

  /// Runs the calibration `name`.
  /// @return the exit code: 0 if the result was kept, or discarded on request; 1 if there is no
  ///         result
  [[nodiscard]] int run(const std::string& name);

 private:
  /// The next step: nullopt to continue, an exit code to end the dialogue.
  using Next = std::optional<int>;

  [[nodiscard]] Next go_on(const gvd::CalibrationStatus& status);
  [[nodiscard]] Next answer_prompt(const gvd::CalibrationStatus& status);
  [[nodiscard]] Next answer(const gvd::CalibrationStatus& status, const std::string& text);
  [[nodiscard]] Next end(const gvd::CalibrationStatus& status);
  [[nodiscard]] int keep(const gvd::CalibrationStatus& status);
  [[nodiscard]] int discard(const gvd::CalibrationStatus& status);
  [[nodiscard]] int give_up(const gvd::CalibrationStatus& status, const std::string& why);
  [[nodiscard]] int fail(const std::string& text) const;
  void show_progress(double progress);

  gvd::ConfigurationClient& client_;
  const Context& context_;
  const std::string& device_;
  const DialogueOptions& options_;
  const program::StopSignal& stop_;
  program::LineReader input_{};
  std::size_t answer_count_ = 0;       ///< How many of the options' answers were given.
  std::uint32_t shown_prompt_ = 0;     ///< The last prompt that was printed.
  std::uint32_t answered_prompt_ = 0;  ///< The last prompt that was answered.
  bool is_asked_ = false;              ///< The operator was asked whether to keep the result.
  int shown_percent_ = 0;
};

}  // namespace rtpm::tool
