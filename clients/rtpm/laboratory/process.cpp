#include "laboratory/process.hpp"

#include <fcntl.h>
#include <poll.h>
#include <spawn.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <utility>

#include "rtpm/program/stop_signal.hpp"
#include "rtpm/rt/clock.hpp"

namespace rtpm::laboratory {
namespace {

constexpr std::size_t kLineSizeMax = 4096;  // Longer lines are split.

/// The arguments for exec, which does not modify the texts.
std::vector<char*> pointers_to(Words& texts) {
  std::vector<char*> pointers;
  for (std::string& text : texts)
    pointers.push_back(text.data());
  pointers.push_back(nullptr);
  return pointers;
}

Words environment_with(const Variables& changes) {
  Words variables;
  for (const auto& [name, value] : changes)
    variables.push_back(name + "=" + value);
  for (char** variable = ::environ; *variable != nullptr; ++variable) {
    const std::string text = *variable;
    if (!changes.contains(text.substr(0, text.find('=')))) variables.push_back(text);
  }
  return variables;
}

}  // namespace

expected<Process, SetupError> launch(const std::string& path, Words arguments,
                                     const Variables& environment, const std::string& folder,
                                     bool has_terminal) {
  Process process;
  std::array<transport::Descriptor, 2> theirs{};
  posix_spawn_file_actions_t actions;
  ::posix_spawn_file_actions_init(&actions);
  for (std::size_t i = 0; i < 2 && !has_terminal; ++i) {
    std::array<int, 2> ends{-1, -1};
    static_cast<void>(!::pipe2(ends.data(), O_CLOEXEC));  // Without pipes, the program fails below.
    ::fcntl(ends[0], F_SETFL, O_NONBLOCK);                // The programs' ends must block.
    process.streams[i].descriptor = transport::Descriptor(ends[0]);
    theirs[i] = transport::Descriptor(ends[1]);
    ::posix_spawn_file_actions_adddup2(&actions, ends[1], STDOUT_FILENO + static_cast<int>(i));
  }
  if (!has_terminal)
    ::posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  ::posix_spawn_file_actions_addchdir_np(&actions, folder.c_str());
  ::posix_spawn_file_actions_addclosefrom_np(&actions, STDERR_FILENO + 1);
  sigset_t signals;
  posix_spawnattr_t attributes;
  ::posix_spawnattr_init(&attributes);
  ::sigemptyset(&signals);
  ::posix_spawnattr_setsigmask(&attributes, &signals);
  ::sigfillset(&signals);
  ::posix_spawnattr_setsigdefault(&attributes, &signals);
  const int group = has_terminal ? 0 : POSIX_SPAWN_SETPGROUP;
  ::posix_spawnattr_setflags(
      &attributes, static_cast<short>(POSIX_SPAWN_SETSIGDEF | POSIX_SPAWN_SETSIGMASK | group));
  Words variables = environment_with(environment);
  const int error = ::posix_spawn(&process.id, path.c_str(), &actions, &attributes,
                                  pointers_to(arguments).data(), pointers_to(variables).data());
  ::posix_spawnattr_destroy(&attributes);
  ::posix_spawn_file_actions_destroy(&actions);
  if (error == 0) return process;
  return setup_error(path + " does not start in " + folder, system_error(error));
}

void read_lines(Process::Stream& stream, bool has_ended,
                const std::function<void(std::string_view line)>& take) {
  std::array<char, std::size_t{64} * 1024> part{};  // As much as a pipe can hold.
  const ssize_t size = ::read(stream.descriptor.number(), part.data(), part.size());
  if (size > 0) stream.text.append(part.data(), static_cast<std::size_t>(size));
  std::size_t begin = 0;
  for (std::size_t end = 0; (end = stream.text.find('\n', begin)) != std::string::npos;
       begin = end + 1)
    take(std::string_view(stream.text).substr(begin, end - begin));
  stream.text.erase(0, begin);
  const bool is_over = has_ended || size == 0;
  if (stream.text.size() > kLineSizeMax || (is_over && !stream.text.empty()))
    take(std::exchange(stream.text, {}));
  if (is_over) stream.descriptor = transport::Descriptor();
}

sigset_t become_parent() {
  ::prctl(PR_SET_CHILD_SUBREAPER, 1);
  sigset_t signals;
  ::sigemptyset(&signals);
  for (const int signal : program::stop_signals())
    ::sigaddset(&signals, signal);
  ::sigaddset(&signals, SIGCHLD);
  ::pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  return signals;
}

bool end_children(Duration patience) {
  const std::string list = "/proc/self/task/" + std::to_string(::getpid()) + "/children";
  const MonotonicTime kill_time = rt::now() + patience;
  for (int signal = SIGTERM; rt::now() < kill_time + std::chrono::seconds{2};) {
    pid_t ended = 0;
    while ((ended = ::waitpid(-1, nullptr, WNOHANG)) > 0) {
    }
    if (ended < 0) return true;
    if (rt::now() >= kill_time) signal = SIGKILL;
    // Repeats SIGKILL, because the children of a killed process become this one's. A child's pid
    // can't be reused before it is reaped.
    std::ifstream children(list);
    for (pid_t child = 0; signal != 0 && children >> child;)
      ::kill(child, signal);
    if (signal == SIGTERM) signal = 0;
    static_cast<void>(::poll(nullptr, 0, 10));
  }
  return false;
}

expected<std::optional<int>, SetupError> run_guarded(const std::function<int()>& work,
                                                     Duration patience) {
  const sigset_t signals = become_parent();
  std::fflush(nullptr);  // Otherwise both processes would write the buffered output.
  const pid_t guard = ::getpid();
  const pid_t child = ::fork();
  if (child < 0) return setup_error("the supervisor does not start", system_error(errno));
  if (child == 0) {
    ::prctl(PR_SET_PDEATHSIG, SIGTERM);
    if (::getppid() != guard) ::raise(SIGTERM);  // The guard ended before the line above.
    std::exit(work());
  }
  for (;;) {
    int status = 0;
    const pid_t ended = ::waitpid(-1, &status, WNOHANG);
    if (ended == child && WIFEXITED(status)) return WEXITSTATUS(status);
    if (ended == child) break;
    siginfo_t signal{};
    if (ended > 0 || ::sigwaitinfo(&signals, &signal) == SIGCHLD) continue;
    // The child receives the terminal's signals itself, as it is in the same group.
    if (signal.si_signo > 0 && signal.si_code != SI_KERNEL) ::kill(child, signal.si_signo);
  }
  end_children(patience);
  return std::nullopt;
}

}  // namespace rtpm::laboratory
