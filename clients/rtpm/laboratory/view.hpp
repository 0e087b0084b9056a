#pragma once

#include <cstddef>
#include <deque>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "cli/context.hpp"
#include "cli/output.hpp"
#include "laboratory/log_file.hpp"
#include "laboratory/plan.hpp"
#include "laboratory/supervisor.hpp"

namespace rtpm::tool {

/// Shows a laboratory: on a terminal a table below the programs' output, otherwise a line for each
/// change, with --json a document. If a program has the terminal, shows only problems.
/// @ownership refers to its plan
/// @threads  one
class LaboratoryView : public laboratory::Observer {
 public:
  LaboratoryView(const laboratory::Plan& plan, bool as_json, bool is_quiet);

  void on_change(std::size_t program, const laboratory::ProgramStatus& status) override;
  void on_output(std::size_t program, bool is_error, std::string_view line) override;
  void on_up() override;
  void on_stop(std::string_view why) override;
  void on_turn(const laboratory::Supervision& supervision) override;

  /// From now on, all output goes to `log`, as lines.
  void move_to(laboratory::LogFile log);
  /// Prints the output that was held back.
  void finish();
  /// "devices (exit code 1), servo (SIGKILL)"; empty if there are none.
  [[nodiscard]] std::string failed_programs() const;

 protected:
  [[nodiscard]] const laboratory::Plan& plan() const noexcept { return plan_; }

 private:
  struct Shown {
    laboratory::State state = laboratory::State::kWaiting;
    int process = 0;
    std::string note{};
    std::deque<std::string> hidden{};  ///< The last lines that were not shown.
    std::string kept{};                ///< The output kept by Output::kEnd.
  };
  void print(std::string line);
  void print_event(const Json& event);
  void draw(const laboratory::Supervision& supervision, MonotonicTime now);
  void hide(std::size_t program, std::string_view line);
  void show_hidden(std::size_t program);
  [[nodiscard]] double elapsed_s() const;

  const laboratory::Plan& plan_;
  const bool is_json_;
  const bool is_quiet_;
  bool has_table_;
  MonotonicTime begin_;
  MonotonicTime last_draw_{};
  MonotonicTime next_draw_{};
  bool must_draw_ = true;
  std::vector<Shown> shown_;
  std::string pending_{};  ///< Lines to print above the table.
  std::size_t table_height_ = 0;
  std::optional<laboratory::LogFile> log_{};
};

}  // namespace rtpm::tool
