#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "cli/context.hpp"
#include "rtpm/configuration/client.hpp"
#include "rtpm/options/line_reader.hpp"

namespace rtpm::tool {

/// What an operator may say beforehand.
struct DialogueOptions {
  std::vector<std::string> answers{};  ///< To the prompts; the last stands for more.
  bool keeps = false;                  ///< The result, without asking,
  bool discards = false;               ///< or not.
};

/// A calibration with an operator: prints prompts, progress and result, and reads answers from the
/// options, then from standard input. A run that it leaves is discarded.
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

  /// Plays the calibration `name`.
  /// @return the exit code: 0 the result was kept, or discarded as told; 1 there is none
  [[nodiscard]] int run(const std::string& name);

 private:
  /// What to do next; an exit code ends the dialogue.
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
  const options::StopSignal& stop_;
  options::LineReader input_{};
  std::size_t answer_count_ = 0;       ///< Of the options', given.
  std::uint32_t shown_prompt_ = 0;     ///< The prompt that was printed last,
  std::uint32_t answered_prompt_ = 0;  ///< and answered.
  bool is_asked_ = false;              ///< Whether to keep the result.
  int shown_percent_ = 0;
};

}  // namespace rtpm::tool
