#include "laboratory/supervisor.hpp"

#include <poll.h>
#include <signal.h>
#include <sys/signalfd.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <string>
#include <utility>

#include "laboratory/process_tree.hpp"
#include "rtpm/options/stop_signal.hpp"
#include "rtpm/rt/clock.hpp"

namespace rtpm::laboratory {
namespace {

constexpr Duration kTurn = std::chrono::milliseconds{250};
/// One request may arrive twice: from the terminal, and from the process above.
constexpr Duration kSecondRequest = std::chrono::milliseconds{500};

ProcessEnd end_of(int status) {
  if (WIFEXITED(status)) return {.exit_code = WEXITSTATUS(status)};
  return {.signal = WTERMSIG(status)};
}

/// The URL in a line such as "serving lab/arm0 at rtpm://127.0.0.1:4711/lab/arm0".
std::string url_in(std::string_view line) {
  const std::size_t begin = line.find("rtpm://");
  if (begin == std::string_view::npos) return {};
  const std::string_view rest = line.substr(begin);
  return std::string(rest.substr(0, rest.find_first_of(" \t\r,;\"'")));
}

}  // namespace

Supervisor::Supervisor(const Plan& plan, Observer& observer, const SupervisorOptions& options)
    : plan_(plan),
      observer_(observer),
      options_(options),
      supervision_(plan, rt::now()),
      running_(plan.programs.size()),
      logs_(plan.programs.size()),
      former_names_(plan.programs.size()) {}

Supervisor::~Supervisor() = default;

expected<std::unique_ptr<Supervisor>, SetupError> Supervisor::create(
    const Plan& plan, Observer& observer, const SupervisorOptions& options) {
  sigset_t signals;
  ::sigemptyset(&signals);
  for (const int signal : options::stop_signals())
    ::sigaddset(&signals, signal);
  for (const int signal : {SIGCHLD, SIGWINCH})
    ::sigaddset(&signals, signal);
  // Blocked before the thread that polls names starts, so that it inherits the mask.
  ::pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  std::unique_ptr<Supervisor> supervisor(new Supervisor(plan, observer, options));
  supervisor->signals_ = Handle(::signalfd(-1, &signals, SFD_CLOEXEC | SFD_NONBLOCK));
  if (!supervisor->signals_.is_open() || supervisor->names_.event() < 0) {
    return setup_error("there is no descriptor for signals", system_error(errno),
                       "raise the limit of open files (ulimit -n)");
  }
  for (std::size_t i = 0; i < plan.programs.size() && !plan.log_folder.empty(); ++i) {
    auto log = LogFile::open(plan.log_folder + "/" + plan.programs[i].name + ".log");
    if (!log) return unexpected{log.error()};
    supervisor->logs_[i] = std::move(*log);
  }
  if (options.time) supervisor->end_ = rt::now() + *options.time;
  return supervisor;
}

bool Supervisor::run() {
  adopt_orphans();
  for (;;) {
    const MonotonicTime now = rt::now();
    if (now >= end_) {
      end_ = kNever;
      has_run_out_of_time_ = !supervision_.is_stopping();
      request_stop("its time is over");
    }
    act(now);
    ask_for_names();
    observer_.on_turn(supervision_);
    if (supervision_.is_over()) break;
    wait(now);
    take_signals();
    take_lifeline();
    for (std::size_t i = 0; i < running_.size(); ++i)
      take_output(i);
    take_names();
    take_ends();
  }
  // Ends processes that programs have left behind in sessions of their own.
  const bool is_clean = end_descendants(Duration{0});
  return is_clean && !supervision_.has_failed();
}

void Supervisor::act(MonotonicTime now) {
  for (;;) {
    const auto actions = supervision_.due(now);
    for (const auto& [order, program] : actions) {
      if (order == Supervision::Order::kStart) {
        start(program, now);
      } else if (running_[program]) {
        const bool is_stop = order == Supervision::Order::kStop;
        running_[program]->send_signal(is_stop ? plan_.programs[program].stop_signal : SIGKILL);
        // A process that is stopped (SIGSTOP) handles no signal except SIGKILL.
        running_[program]->send_signal(SIGCONT);
      }
    }
    for (const std::size_t program : supervision_.take_changes())
      observer_.on_change(program, supervision_.status(program));
    if (supervision_.is_up() && !std::exchange(was_up_, supervision_.is_up())) observer_.on_up();
    if (actions.empty()) return;
  }
}

void Supervisor::start(std::size_t program, MonotonicTime now) {
  auto started =
      RunningProgram::start(plan_.programs[program], urls(), registry_url(), options_.has_terminal);
  if (!started) {
    supervision_.not_started(program, started.error().reason(), now);
    return;
  }
  running_[program] = std::move(*started);
  supervision_.started(program, running_[program]->process(), now);
}

void Supervisor::wait(MonotonicTime now) {
  std::vector<pollfd> waited{{signals_.number(), POLLIN, 0}, {names_.event(), POLLIN, 0}};
  if (options_.lifeline >= 0) waited.push_back({options_.lifeline, POLLIN, 0});
  for (const auto& program : running_) {
    if (!program) continue;
    for (const int stream : program->streams()) {
      if (stream >= 0) waited.push_back({stream, POLLIN, 0});
    }
  }
  const MonotonicTime next = std::min({supervision_.next(), end_, now + kTurn});
  const auto ms = std::chrono::ceil<std::chrono::milliseconds>(next - now).count();
  static_cast<void>(::poll(waited.data(), waited.size(),
                           static_cast<int>(std::clamp<decltype(ms)>(ms, 0, 1000))));
}

void Supervisor::take_signals() {
  signalfd_siginfo signal{};
  while (::read(signals_.number(), &signal, sizeof signal) == sizeof signal) {
    switch (signal.ssi_signo) {
      case SIGINT:
        request_stop("SIGINT");
        break;
      case SIGTERM:
        request_stop("SIGTERM");
        break;
      case SIGHUP:
        request_stop("its terminal is gone");
        break;
      case SIGQUIT:
        request_stop("SIGQUIT");
        break;
      default:
        break;  // SIGCHLD and SIGWINCH end the wait.
    }
  }
}

void Supervisor::take_lifeline() {
  if (options_.lifeline < 0) return;
  pollfd waited{options_.lifeline, POLLIN, 0};
  if (::poll(&waited, 1, 0) <= 0) return;
  char byte = 0;
  const ssize_t size = ::read(options_.lifeline, &byte, 1);
  if (size == 1) {
    request_stop("SIGTERM");
  } else if (size == 0) {
    options_.lifeline = -1;
    request_stop("rtpm was killed");
  }
}

void Supervisor::request_stop(std::string_view why) {
  const MonotonicTime now = rt::now();
  if (!stop_time_) {
    stop_time_ = now;
    if (!supervision_.is_stopping()) observer_.on_stop(why);
    supervision_.stop(now);
  } else if (now - *stop_time_ >= kSecondRequest) {
    supervision_.kill(now);
  }
}

void Supervisor::take_ends() {
  for (;;) {
    siginfo_t ended{};
    // The process is not reaped yet, so its group's number can't be reused.
    if (::waitid(P_ALL, 0, &ended, WEXITED | WNOHANG | WNOWAIT) != 0 || ended.si_pid == 0) return;
    const auto found = std::ranges::find_if(running_, [&](const auto& program) {
      return program && program->process() == ended.si_pid;
    });
    int status = 0;
    if (found == running_.end()) {
      ::waitpid(ended.si_pid, &status, 0);
      continue;
    }
    const auto program = static_cast<std::size_t>(found - running_.begin());
    (*found)->send_signal(SIGKILL);  // Kills the processes that it has left behind in its group.
    ::waitpid(ended.si_pid, &status, 0);
    (*found)->read_rest(
        [&](bool is_error, std::string_view line) { take_line(program, is_error, line); });
    found->reset();
    supervision_.exited(program, end_of(status), rt::now());
  }
}

void Supervisor::take_output(std::size_t program) {
  if (!running_[program]) return;
  running_[program]->read(
      [&](bool is_error, std::string_view line) { take_line(program, is_error, line); });
}

void Supervisor::take_line(std::size_t program, bool is_error, std::string_view line) {
  const ProgramPlan& plan = plan_.programs[program];
  if (logs_[program]) logs_[program]->write(line);
  observer_.on_output(program, is_error, line);
  const MonotonicTime now = rt::now();
  if (!is_error) {
    if (const std::string url = url_in(line); !url.empty()) supervision_.has_url(program, url, now);
  }
  if (plan.readiness == Readiness::kLine && line.find(plan.ready_line) != std::string_view::npos)
    supervision_.is_ready(program, now);
}

void Supervisor::ask_for_names() {
  const bool is_needed = std::ranges::any_of(plan_.order, [&](std::size_t program) {
    return plan_.programs[program].readiness == Readiness::kNames &&
           supervision_.status(program).state == State::kStarting;
  });
  names_.ask(is_needed ? registry_url() : std::string());
}

void Supervisor::take_names() {
  const NamesProbe::Revisions bound = names_.take();
  if (bound.empty()) return;
  for (std::size_t i = 0; i < plan_.programs.size(); ++i) {
    const ProgramPlan& plan = plan_.programs[i];
    if (plan.readiness != Readiness::kNames || supervision_.status(i).state != State::kStarting)
      continue;
    const bool is_bound = std::ranges::all_of(plan.names, [&](const std::string& name) {
      const auto found = bound.find(name);
      const auto former = former_names_[i].find(name);
      return found != bound.end() &&
             (former == former_names_[i].end() || former->second != found->second);
    });
    if (!is_bound) continue;
    for (const std::string& name : plan.names)
      former_names_[i][name] = bound.at(name);
    supervision_.is_ready(i, rt::now());
  }
}

std::vector<std::string> Supervisor::urls() const {
  std::vector<std::string> urls;
  for (std::size_t i = 0; i < plan_.programs.size(); ++i)
    urls.push_back(supervision_.status(i).url);
  return urls;
}

std::string Supervisor::registry_url() const {
  if (plan_.registry_program) return supervision_.status(*plan_.registry_program).url;
  return plan_.registry_url.empty() ? options_.registry_url : plan_.registry_url;
}

}  // namespace rtpm::laboratory
