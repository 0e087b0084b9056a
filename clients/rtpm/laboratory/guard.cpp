#include "laboratory/guard.hpp"

#include <poll.h>
#include <signal.h>
#include <sys/signalfd.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <optional>

#include "laboratory/process.hpp"
#include "laboratory/process_tree.hpp"
#include "rtpm/options/stop_signal.hpp"

namespace rtpm::laboratory {
namespace {

/// The end of the process; nullopt while it runs.
std::optional<GuardedEnd> end_of(pid_t id) {
  int status = 0;
  pid_t ended = 0;
  do {
    ended = ::waitpid(id, &status, WNOHANG);
  } while (ended < 0 && errno == EINTR);
  if (ended != id) return std::nullopt;
  if (WIFEXITED(status)) return GuardedEnd{.exit_code = WEXITSTATUS(status)};
  return GuardedEnd{.exit_code = 1, .was_killed = true};
}

/// Waits for the end of the work; forwards signals meanwhile.
GuardedEnd watch(pid_t work, int signals, int lifeline) {
  for (;;) {
    if (const auto end = end_of(work)) return *end;
    pollfd waited{signals, POLLIN, 0};
    static_cast<void>(::poll(&waited, 1, -1));
    signalfd_siginfo signal{};
    while (::read(signals, &signal, sizeof signal) == sizeof signal) {
      if (signal.ssi_signo == SIGCHLD || signal.ssi_code == SI_KERNEL) continue;
      static_cast<void>(!::write(lifeline, "t", 1));
    }
  }
}

}  // namespace

expected<GuardedEnd, SetupError> run_guarded(const std::function<int(int lifeline)>& work,
                                             Duration patience, bool leaves_terminal) {
  sigset_t set;
  ::sigemptyset(&set);
  for (const int signal : options::stop_signals())
    ::sigaddset(&set, signal);
  ::sigaddset(&set, SIGCHLD);
  ::pthread_sigmask(SIG_BLOCK, &set, nullptr);
  const Handle signals(::signalfd(-1, &set, SFD_CLOEXEC | SFD_NONBLOCK));
  auto lifeline = make_pipe();
  if (!signals.is_open() || !lifeline) {
    return setup_error("there is no descriptor to watch the laboratory", system_error(errno),
                       "raise the limit of open files (ulimit -n)");
  }
  adopt_orphans();
  std::fflush(nullptr);  // Otherwise both processes would write the buffered output.
  const pid_t id = ::fork();
  if (id < 0) return setup_error("the supervisor does not start", system_error(errno));
  if (id == 0) {
    (*lifeline)[1].reset();
    std::exit(work((*lifeline)[0].number()));
  }
  (*lifeline)[0].reset();
  if (leaves_terminal) leave_terminal();
  const GuardedEnd end = watch(id, signals.number(), (*lifeline)[1].number());
  end_descendants(end.was_killed ? patience : Duration{0});
  return end;
}

}  // namespace rtpm::laboratory
