#include <poll.h>
#include <signal.h>
#include <sys/signalfd.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <utility>

#include "cli/output.hpp"
#include "laboratory/commands.hpp"
#include "laboratory/process.hpp"
#include "rtpm/base/printable.hpp"
#include "rtpm/names/directory.hpp"
#include "rtpm/program/duration.hpp"
#include "rtpm/program/stop_signal.hpp"
#include "rtpm/program/text.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/log.hpp"

namespace rtpm::tool {
namespace {

using laboratory::Output;
using laboratory::Plan;
using laboratory::ProgramPlan;

constexpr Duration kRestartDelay = std::chrono::milliseconds{200};
/// A program that fails more often than this within kRestartWindow is not restarted.
constexpr std::size_t kRestartCountMax = 5;
constexpr Duration kRestartWindow = std::chrono::minutes{1};
constexpr int kTurnMs = 50;
constexpr Duration kNamesDeadline = std::chrono::milliseconds{200};
/// The same request may arrive twice: from the terminal, and from the guard.
constexpr Duration kSecondRequest = std::chrono::milliseconds{500};
constexpr std::size_t kKeptSizeMax = std::size_t{256} * 1024;
/// A shell's exit code if SIGTERM ended its command.
constexpr int kShellTerminated = 128 + SIGTERM;

enum class State : std::uint8_t {
  kWaiting,  ///< Waits for the programs that must start first.
  kPausing,  ///< Between its end and its restart.
  kStarting,
  kServing,
  kStopping,
  kDone,  ///< Ended by itself, successfully.
  kFailed,
  kEnded,  ///< Ended because the laboratory ends.
};
constexpr std::array kStateWords{"waiting",  "pausing", "starting", "serving",
                                 "stopping", "done",    "failed",   "ended"};

std::string signal_text(int signal) {
  const char* const name = ::sigabbrev_np(signal);
  return name == nullptr ? "signal " + std::to_string(signal) : "SIG" + std::string(name);
}

/// The URL in a line such as "serving lab/arm0 at rtpm://127.0.0.1:4711/lab/arm0".
std::string url_in(std::string_view line) {
  const std::size_t begin = std::min(line.find("rtpm://"), line.size());
  return std::string(line.substr(begin, line.find_first_of(" \t\r,;\"'", begin) - begin));
}

class Supervisor {
 public:
  Supervisor(Context& context, const Plan& plan, bool has_terminal, int report)
      : context_(context), plan_(plan), report_(report) {
    for (const ProgramPlan& program : plan_.programs) {
      const bool is_shown = has_terminal && program.output == Output::kTerminal;
      programs_.push_back({.plan = program, .has_terminal = is_shown});
      is_quiet_ = is_quiet_ || is_shown;
    }
  }

  int run() {
    const sigset_t signals = laboratory::become_parent();
    signals_ = transport::Descriptor(::signalfd(-1, &signals, SFD_CLOEXEC | SFD_NONBLOCK));
    if (!signals_.is_open())
      return context_.fail(SetupError{"no descriptor for signals", system_error(errno).message()});
    for (advance(); !std::ranges::all_of(programs_, is_final); advance()) {
      wait();
      take_signals();
      for (Program& program : programs_) {
        take_output(program, false);
        take_names(program);
      }
      take_ends();
    }
    return finish();
  }

 private:
  struct Program {
    const ProgramPlan& plan;
    bool has_terminal = false;
    State state = State::kWaiting;
    std::string note{};               ///< Why it is in this state, a clause.
    MonotonicTime deadline = kNever;  ///< When the state times out.
    bool has_line = false;
    bool has_url = false;
    bool has_names = false;
    bool was_killed = false;
    laboratory::Process process{};
    std::vector<MonotonicTime> restarts{};
    std::string url{};
    /// The revisions of its names when it last served: names of a killed program stay bound for a
    /// while.
    std::vector<std::uint64_t> revisions{};
    std::string kept{};  ///< The output kept by Output::kEnd.
  };

  static bool is_running(const Program& program) {
    return program.state >= State::kStarting && program.state <= State::kStopping;
  }
  static bool serves(const Program& program) {
    return program.state == State::kServing || program.state == State::kDone;
  }
  static bool is_final(const Program& program) { return program.state >= State::kDone; }

  /// Does everything that is due.
  void advance() {
    std::size_t before = 0;
    do {  // One program's change may allow another one to proceed.
      before = change_count_;
      for (const std::size_t program : plan_.order)
        advance(programs_[program]);
      if (!is_up_ && std::ranges::all_of(programs_, serves)) come_up();
      std::size_t main_count = 0, ended_count = 0;
      for (const Program& program : programs_) {
        main_count += program.plan.is_main;
        ended_count += program.plan.is_main && is_final(program);
      }
      if (main_count > 0 && main_count == ended_count) stop();
    } while (before != change_count_);
  }

  void advance(Program& program) {
    const bool is_due = rt::now() >= program.deadline;
    switch (program.state) {
      case State::kPausing:
      case State::kWaiting:
        if (is_stopping_) return enter(program, State::kEnded);
        if (program.state == State::kWaiting || is_due) start(program);
        return;
      case State::kStarting:
        if (is_due) {
          return stop(program, "it did not serve within " +
                                   program::duration_text(program.plan.ready_deadline));
        }
        [[fallthrough]];
      case State::kServing:
        if (is_stopping_ && !is_needed_by_running(program)) stop(program, {});
        return;
      case State::kStopping:
        if (!is_due) return;
        program.was_killed = true;
        program.deadline = kNever;
        return send_signal(program, SIGKILL);
      default:
        return;
    }
  }

  [[nodiscard]] bool is_needed_by_running(const Program& program) const {
    const auto index = static_cast<std::size_t>(&program - programs_.data());
    return std::ranges::any_of(programs_, [&](const Program& other) {
      return is_running(other) && std::ranges::count(other.plan.after, index) > 0;
    });
  }

  /// Starts the program if its predecessors serve.
  void start(Program& program) {
    for (const std::size_t index : program.plan.after) {
      const Program& other = programs_[index];
      if (other.state == State::kFailed)
        return fail(program, other.plan.name + ", which it comes after, has failed");
      if (!serves(other)) return;
    }
    program.has_line = program.has_url = program.has_names = program.was_killed = false;
    laboratory::Words arguments;
    for (const std::string& word : program.plan.command)
      arguments.push_back(expand(word));
    laboratory::Variables environment;
    for (const auto& [name, value] : program.plan.environment)
      environment[name] = expand(value);
    auto process = laboratory::launch(program.plan.path, arguments, environment, plan_.folder,
                                      program.has_terminal);
    if (!process) return restart_or_fail(program, process.error().reason());
    program.process = std::move(*process);
    enter(program, State::kStarting, {}, rt::now() + program.plan.ready_deadline);
    serve_if_ready(program);
  }

  /// Expands the text, which read_plan() has checked.
  [[nodiscard]] std::string expand(const std::string& text) const {
    return laboratory::expanded(text, plan_.variables).value_or("");
  }

  void serve_if_ready(Program& program) {
    const ProgramPlan& plan = program.plan;
    const bool is_ready = !plan.is_one_shot && (plan.ready_line.empty() || program.has_line) &&
                          (!plan.must_print_url || program.has_url) &&
                          (plan.names.empty() || program.has_names);
    if (is_ready && program.state == State::kStarting) enter(program, State::kServing);
  }

  void stop(Program& program, std::string why) {
    enter(program, State::kStopping, std::move(why), rt::now() + program.plan.stop_patience);
    send_signal(program, SIGTERM);
  }

  static void send_signal(const Program& program, int signal) {
    const pid_t process = program.has_terminal ? program.process.id : -program.process.id;
    ::kill(process, signal);
    ::kill(process, SIGCONT);  // A stopped process handles no SIGTERM.
  }

  /// Handles the end of its process. @param status  see waitpid(2)
  void exited(Program& program, int status) {
    const int code = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
    const std::string how =
        code >= 0 ? "exit code " + std::to_string(code) : signal_text(WTERMSIG(status));
    program.process = {};
    if (is_killing_) return enter(program, State::kEnded, "killed");
    if (program.state != State::kStopping) {
      if (code != 0) return restart_or_fail(program, how);
      if (program.state == State::kServing || program.plan.is_one_shot)
        return enter(program, State::kDone);
      return restart_or_fail(program, "it ended before it served");
    }
    if (!program.note.empty()) return restart_or_fail(program, program.note);
    if (program.was_killed) {
      return fail(program, "it did not end within " +
                               program::duration_text(program.plan.stop_patience) +
                               " of SIGTERM and was killed");
    }
    if (code == 0 || code == kShellTerminated || (code < 0 && WTERMSIG(status) == SIGTERM))
      return enter(program, State::kEnded);
    fail(program, how);
  }

  void restart_or_fail(Program& program, const std::string& how) {
    if (!program.plan.is_restarted || is_stopping_) return fail(program, how);
    const MonotonicTime now = rt::now();
    std::erase_if(program.restarts, [&](MonotonicTime at) { return now - at > kRestartWindow; });
    if (program.restarts.size() == kRestartCountMax)
      return fail(program, how + ", after " + std::to_string(kRestartCountMax) +
                               " restarts within " + program::duration_text(kRestartWindow));
    program.restarts.push_back(now);
    enter(program, State::kPausing, how, now + kRestartDelay);
  }

  void fail(Program& program, std::string how) {
    enter(program, State::kFailed, std::move(how));
    failures_ += (failures_.empty() ? "" : "; ") + program.plan.name + ": " + program.note;
    if (!is_up_ || program.plan.is_needed) stop();
  }

  void enter(Program& program, State state, std::string note = {},
             MonotonicTime deadline = kNever) {
    program.state = state;
    program.note = std::move(note);
    program.deadline = deadline;
    ++change_count_;
    const char* const word = kStateWords[static_cast<std::size_t>(state)];
    const std::string& name = program.plan.name;
    std::string line = name + ": " +
                       (state == State::kServing  ? coloured(word, Colour::kGreen)
                        : state == State::kFailed ? coloured(word, Colour::kRed)
                                                  : word);
    if (!program.note.empty()) line += ": " + printable(program.note);
    if (state == State::kServing && !program.url.empty()) line += " at " + printable(program.url);
    if (state == State::kStarting) line += ", process " + std::to_string(program.process.id);
    show({{"event", "state"},
          {"program", name},
          {"state", word},
          {"process", program.process.id},
          {"restarts", program.restarts.size()},
          {"url", program.url},
          {"note", program.note}},
         line);
    if (is_quiet_ && (state == State::kFailed || state == State::kPausing))
      rt::print_error("rtpm", name + ": " + word + ": " + program.note);
  }

  void come_up() {
    is_up_ = true;
    show({{"event", "up"}, {"laboratory", plan_.name}}, plan_.name + " is up");
    static_cast<void>(!::write(report_, "u", 1));
  }

  void stop() {
    if (!std::exchange(is_stopping_, true)) ++change_count_;
  }

  void request_stop(const std::string& why) {
    if (!stop_time_) {
      stop_time_ = rt::now();
      show({{"event", "stopping"}, {"why", why}}, plan_.name + " ends: " + why);
      stop();
    } else if (rt::now() - *stop_time_ >= kSecondRequest) {
      is_killing_ = true;
      for (Program& program : programs_)
        if (is_running(program)) send_signal(program, SIGKILL);
    }
  }

  /// Prints an event of the laboratory.
  void show(Json event, const std::string& line) const {
    const double time_s = std::chrono::duration<double>(rt::now() - begin_).count();
    event["time_s"] = time_s;
    if (context_.json) return print_json(event);
    if (!is_quiet_)
      print_line(coloured(program::formatted("[%7.1f s] ", time_s), Colour::kGrey) + line);
  }

  void take_line(Program& program, bool is_error, std::string_view line) {
    const ProgramPlan& plan = program.plan;
    if (line.find(plan.ready_line) != std::string_view::npos) program.has_line = true;
    const std::string url = is_error ? std::string() : url_in(line);
    if (!url.empty() && !std::exchange(program.has_url, true)) {
      const std::string former = std::exchange(program.url, url);
      plan_.variables[plan.name + ".url"] = url;
      if (!former.empty() && former != url) stop_users(program);
    }
    if (context_.json) {
      show({{"event", "output"},
            {"program", plan.name},
            {"stream", is_error ? "stderr" : "stdout"},
            {"line", line}},
           {});
    } else if (plan.output == Output::kEnd) {
      program.kept += printable(line, kShownWhole) + "\n";
      if (program.kept.size() > kKeptSizeMax)
        program.kept.erase(0, program.kept.find('\n', program.kept.size() - kKeptSizeMax) + 1);
    } else if (plan.output != Output::kErrors || is_error) {
      print_line(coloured(plan.name + " | ", Colour::kGrey) + printable(line, kShownWhole));
    }
    serve_if_ready(program);
  }

  /// Stops programs that were started with a URL that is no longer valid.
  void stop_users(const Program& program) {
    const auto index = static_cast<std::size_t>(&program - programs_.data());
    for (Program& user : programs_) {
      const bool is_serving = user.state == State::kStarting || user.state == State::kServing;
      if (is_serving && std::ranges::count(user.plan.uses, index) > 0)
        stop(user, program.plan.name + " has another URL");
    }
  }

  /// Waits for output, the end of a process, a signal or, if there are deadlines, kTurn.
  void wait() {
    std::vector<pollfd> waited{{signals_.number(), POLLIN, 0}};
    for (const Program& program : programs_) {
      for (const auto& stream : program.process.streams)
        waited.push_back({stream.descriptor.number(), POLLIN, 0});
    }
    static_cast<void>(::poll(waited.data(), waited.size(), kTurnMs));
  }

  void take_signals() {
    signalfd_siginfo signal{};
    while (::read(signals_.number(), &signal, sizeof signal) == sizeof signal)
      if (signal.ssi_signo != SIGCHLD)
        request_stop(signal_text(static_cast<int>(signal.ssi_signo)));
  }

  /// Checks whether a program's names are bound, which means that it is serving.
  void take_names(Program& program) {
    if (program.state != State::kStarting || program.plan.names.empty() || program.has_names)
      return;
    const auto own = program.plan.environment.find("RTPM_REGISTRY");
    const bool has_own = own != program.plan.environment.end();
    names::Directory directory(context_.node(), has_own ? expand(own->second) : context_.registry,
                               kNamesDeadline);
    program.revisions.resize(program.plan.names.size());
    std::vector<std::uint64_t> revisions;
    for (std::size_t i = 0; i < program.plan.names.size(); ++i) {
      const auto entry = directory.resolve(expand(program.plan.names[i]));
      if (!entry || entry->revision == program.revisions[i]) return;
      revisions.push_back(entry->revision);
    }
    program.revisions = std::move(revisions);
    program.has_names = true;
    serve_if_ready(program);
  }

  void take_output(Program& program, bool is_over) {
    for (std::size_t i = 0; i < 2; ++i) {
      laboratory::read_lines(program.process.streams[i], is_over,
                             [&](std::string_view line) { take_line(program, i == 1, line); });
    }
  }

  void take_ends() {
    for (siginfo_t ended{};;) {
      ended.si_pid = 0;
      // The process is not reaped yet, so its group's id can't be reused.
      if (::waitid(P_ALL, 0, &ended, WEXITED | WNOHANG | WNOWAIT) != 0 || ended.si_pid == 0) return;
      const auto program = std::ranges::find_if(
          programs_, [&](const Program& p) { return p.process.id == ended.si_pid; });
      if (program != programs_.end())
        send_signal(*program, SIGKILL);  // Ends the rest of its group.
      int status = 0;
      ::waitpid(ended.si_pid, &status, 0);
      if (program == programs_.end()) continue;
      take_output(*program, true);
      exited(*program, status);
    }
  }

  /// @return the exit code
  int finish() {
    if (!laboratory::end_children(Duration{0})) failures_ += " a process could not be ended";
    for (const Program& program : programs_)
      if (!program.kept.empty()) std::printf("\n%s", program.kept.c_str());
    if (failures_.empty()) return kDone;
    return context_.fail(SetupError{"the laboratory '" + plan_.name + "' failed", failures_});
  }

  Context& context_;
  Plan plan_;
  const int report_;
  const MonotonicTime begin_ = rt::now();
  std::vector<Program> programs_{};
  transport::Descriptor signals_{};
  bool is_quiet_ = false;  ///< A program has the terminal, so only problems are shown.
  bool is_up_ = false;     ///< Everything serves, or has served before.
  bool is_stopping_ = false;
  bool is_killing_ = false;
  std::optional<MonotonicTime> stop_time_{};
  std::size_t change_count_ = 0;
  std::string failures_{};
};

}  // namespace

int supervise(Context& context, const Plan& plan, bool has_terminal, int report) {
  return Supervisor(context, plan, has_terminal, report).run();
}

}  // namespace rtpm::tool
