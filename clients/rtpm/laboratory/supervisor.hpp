#pragma once

#include <array>
#include <cstddef>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "laboratory/log_file.hpp"
#include "laboratory/names_probe.hpp"
#include "laboratory/plan.hpp"
#include "laboratory/process.hpp"
#include "laboratory/running_program.hpp"
#include "laboratory/supervision.hpp"

namespace rtpm::laboratory {

/// Receives the events of a laboratory, on the supervisor's thread.
class Observer {
 public:
  Observer() = default;
  Observer(const Observer&) = delete;
  Observer& operator=(const Observer&) = delete;
  virtual ~Observer() = default;

  virtual void on_change(std::size_t program, const ProgramStatus& status) = 0;
  virtual void on_output(std::size_t program, bool is_error, std::string_view line) = 0;
  /// Every program serves for the first time.
  virtual void on_up() = 0;
  /// The laboratory was asked to end; `why` is a clause.
  virtual void on_stop(std::string_view why) = 0;
  /// Called several times a second, and after each event.
  virtual void on_turn(const Supervision& supervision) = 0;
};

struct SupervisorOptions {
  std::string registry_url{};      ///< Used if the file has no registry.
  bool has_terminal = true;        ///< A program may use the terminal.
  int lifeline = -1;               ///< A byte requests a stop, as does closing its other end.
  std::optional<Duration> time{};  ///< The laboratory ends after this time.
};

/// Runs a laboratory: starts, watches and ends its processes as Supervision decides.
/// @ownership refers to plan and observer, which must outlive it
/// @threads  one, which lasts as long as the programs
/// @realtime set-up only
class Supervisor {
 public:
  /// Blocks options::stop_signals(), SIGCHLD and SIGWINCH from here on.
  /// @errors   no descriptor is free; a log can't be written
  [[nodiscard]] static expected<std::unique_ptr<Supervisor>, SetupError> create(
      const Plan& plan, Observer& observer, const SupervisorOptions& options);
  ~Supervisor();

  /// Runs until the laboratory has ended. No process that it started is left then.
  /// @return whether nothing failed
  [[nodiscard]] bool run();
  /// Whether its time limit ended it.
  [[nodiscard]] bool has_run_out_of_time() const noexcept { return has_run_out_of_time_; }

 private:
  Supervisor(const Plan& plan, Observer& observer, const SupervisorOptions& options);

  void act(MonotonicTime now);
  void start(std::size_t program, MonotonicTime now);
  void wait(MonotonicTime now);
  void take_signals();
  void take_lifeline();
  void take_ends();
  void take_names();
  void take_output(std::size_t program);
  void take_line(std::size_t program, bool is_error, std::string_view line);
  void request_stop(std::string_view why);
  void ask_for_names();
  [[nodiscard]] std::string registry_url() const;
  [[nodiscard]] std::vector<std::string> urls() const;

  const Plan& plan_;
  Observer& observer_;
  SupervisorOptions options_;
  Supervision supervision_;
  Handle signals_{};
  NamesProbe names_{};
  std::vector<std::optional<RunningProgram>> running_{};
  std::vector<std::optional<LogFile>> logs_{};
  /// The names of each program when it last served. A name with this revision is out of date.
  std::vector<NamesProbe::Revisions> former_names_{};
  MonotonicTime end_ = kNever;
  std::optional<MonotonicTime> stop_time_{};
  bool was_up_ = false;
  bool has_run_out_of_time_ = false;
};

}  // namespace rtpm::laboratory
