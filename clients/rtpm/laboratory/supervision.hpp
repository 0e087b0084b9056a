#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "laboratory/plan.hpp"
#include "rtpm/base/time.hpp"

namespace rtpm::laboratory {

enum class State : std::uint8_t {
  kWaiting,   ///< Waits for the programs that it comes after.
  kStarting,  ///< Runs, but does not serve yet.
  kServing,
  kPausing,   ///< Between its end and its restart.
  kStopping,  ///< Was asked to end.
  kDone,      ///< Has ended by itself, with success.
  kFailed,
  kEnded,  ///< Has ended because the laboratory ends.
};

/// "waiting", "starting", …
[[nodiscard]] std::string_view to_string(State state) noexcept;

/// The end of a process.
struct ProcessEnd {
  std::optional<int> exit_code{};
  int signal = 0;  ///< The signal that ended it; there is no exit code then.

  /// "exit code 1", "SIGKILL".
  [[nodiscard]] std::string text() const;
};

/// The status of a laboratory's program.
struct ProgramStatus {
  State state = State::kWaiting;
  MonotonicTime since{};  ///< The start of the state.
  int process = 0;        ///< 0 if it does not run.
  std::size_t restart_count = 0;
  std::string url{};   ///< The URL that it printed.
  std::string note{};  ///< The reason of this state, a clause; may be empty.
};

/// Decides the next actions on a laboratory's programs from the events that it is given: order,
/// readiness, restarts with back-off, an orderly end. It has no clock and starts nothing.
/// @ownership refers to its plan, which must outlive it
/// @threads  one
class Supervision {
 public:
  enum class Order : std::uint8_t { kStart, kStop, kKill };
  struct Action {
    Order order = Order::kStart;
    std::size_t program = 0;
    friend bool operator==(const Action&, const Action&) = default;
  };

  Supervision(const Plan& plan, MonotonicTime now);

  /// The actions that are due now; each action is returned once.
  [[nodiscard]] std::vector<Action> due(MonotonicTime now);
  /// The time at which due() next has work without an event; kNever if only an event brings work.
  [[nodiscard]] MonotonicTime next() const;

  void started(std::size_t index, int process, MonotonicTime now);
  /// The program could not be started; `why` states the reason.
  void not_started(std::size_t index, const std::string& why, MonotonicTime now);
  /// The program printed its URL.
  void has_url(std::size_t index, const std::string& url, MonotonicTime now);
  /// The program's line was printed, or its names are bound.
  void is_ready(std::size_t index, MonotonicTime now);
  void exited(std::size_t index, ProcessEnd end, MonotonicTime now);
  /// Ends the laboratory in order.
  void stop(MonotonicTime now);
  /// Ends the laboratory at once.
  void kill(MonotonicTime now);

  [[nodiscard]] const ProgramStatus& status(std::size_t index) const;
  /// The programs whose status has changed since the last call, in the order of the changes.
  [[nodiscard]] std::vector<std::size_t> take_changes();
  /// Everything serves, or has served before.
  [[nodiscard]] bool is_up() const noexcept { return is_up_; }
  [[nodiscard]] bool is_stopping() const noexcept { return is_stopping_; }
  [[nodiscard]] bool is_over() const;
  [[nodiscard]] bool has_failed() const noexcept { return has_failed_; }

 private:
  /// The reason why a program is stopped while the laboratory runs.
  enum class StopReason : std::uint8_t { kLaboratory, kNotReady, kNewUrl };
  struct Program {
    ProgramStatus status{};
    MonotonicTime deadline = kNever;  ///< The deadline of the state.
    bool is_condition_met = false;    ///< Its URL may still be missing.
    bool has_url = false;             ///< It has printed its URL in this run.
    bool is_killed = false;           ///< Killed because its patience was over.
    bool is_forced = false;           ///< Killed on request.
    StopReason stop_reason = StopReason::kLaboratory;
    std::vector<MonotonicTime> restarts{};
  };

  void advance(MonotonicTime now, std::vector<Action>& actions);
  void advance_start(std::size_t index, MonotonicTime now, std::vector<Action>& actions);
  void advance_stop(std::size_t index, MonotonicTime now, std::vector<Action>& actions);
  void begin_stop(std::size_t index, StopReason reason, MonotonicTime now);
  void judge(std::size_t index, bool is_success, const std::string& how, MonotonicTime now);
  void end_while_stopping(std::size_t index, ProcessEnd end, MonotonicTime now);
  void settle(MonotonicTime now);
  void serve_if_ready(std::size_t index, MonotonicTime now);
  void fail(std::size_t index, std::string note, MonotonicTime now);
  void enter(std::size_t index, State state, std::string note, MonotonicTime now);
  [[nodiscard]] bool is_needed_by_running(std::size_t index) const;

  const Plan& plan_;
  std::vector<Program> programs_{};
  std::vector<std::size_t> changes_{};
  std::vector<Action> pending_{};
  bool is_up_ = false;
  bool is_stopping_ = false;
  bool has_failed_ = false;
};

/// Whether it has ended and is not restarted.
[[nodiscard]] bool is_final(State state) noexcept;
/// Whether its process exists.
[[nodiscard]] bool is_running(State state) noexcept;

}  // namespace rtpm::laboratory
