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
  kWaiting,   ///< For the programs that it comes after.
  kStarting,  ///< It runs, but does not serve yet.
  kServing,
  kPausing,   ///< Between its end and its restart.
  kStopping,  ///< Asked to end.
  kDone,      ///< Ended by itself, with success.
  kFailed,
  kEnded,  ///< Because the laboratory ends.
};

/// "waiting", "starting", …
[[nodiscard]] std::string_view to_string(State state) noexcept;

/// How a process ended.
struct ProcessEnd {
  std::optional<int> exit_code{};
  int signal = 0;  ///< That ended it, without an exit code.

  /// "exit code 1", "SIGKILL".
  [[nodiscard]] std::string text() const;
};

/// What is known of a program of a laboratory.
struct ProgramStatus {
  State state = State::kWaiting;
  MonotonicTime since{};  ///< Of the state.
  int process = 0;        ///< 0: it does not run.
  std::size_t restart_count = 0;
  std::string url{};   ///< Where it serves, as it printed.
  std::string note{};  ///< Why it is in this state, a clause; may be empty.
};

/// Decides what is to be done with a laboratory's programs, from what has happened to them: order,
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

  /// What is to be done now; each action is given once.
  [[nodiscard]] std::vector<Action> due(MonotonicTime now);
  /// When due() has something to do without an event; kNever: only with one.
  [[nodiscard]] MonotonicTime next() const;

  void started(std::size_t index, int process, MonotonicTime now);
  /// It could not be started, as `why` says.
  void not_started(std::size_t index, const std::string& why, MonotonicTime now);
  /// It printed where it serves.
  void has_url(std::size_t index, const std::string& url, MonotonicTime now);
  /// Its line was printed, or its names are bound.
  void is_ready(std::size_t index, MonotonicTime now);
  void exited(std::size_t index, ProcessEnd end, MonotonicTime now);
  /// Ends the laboratory in order.
  void stop(MonotonicTime now);
  /// Ends it at once.
  void kill(MonotonicTime now);

  [[nodiscard]] const ProgramStatus& status(std::size_t index) const;
  /// The programs whose status has changed since the last call, in the order of the changes.
  [[nodiscard]] std::vector<std::size_t> take_changes();
  /// Everything serves, or has done so: true from then on.
  [[nodiscard]] bool is_up() const noexcept { return is_up_; }
  [[nodiscard]] bool is_stopping() const noexcept { return is_stopping_; }
  [[nodiscard]] bool is_over() const;
  [[nodiscard]] bool has_failed() const noexcept { return has_failed_; }

 private:
  /// Why a program is stopped while the laboratory runs.
  enum class StopReason : std::uint8_t { kLaboratory, kNotReady, kNewUrl };
  struct Program {
    ProgramStatus status{};
    MonotonicTime deadline = kNever;  ///< Of the state.
    bool is_condition_met = false;    ///< But its URL may not be known yet.
    bool has_url = false;             ///< Of this life.
    bool is_killed = false;           ///< As its patience was over.
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
