#include "laboratory/process.hpp"

#include <fcntl.h>
#include <linux/close_range.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <string_view>

namespace rtpm::laboratory {
namespace {

/// The failed step of the new process, reported through a pipe that exec closes.
struct Failure {
  int number = 0;
  bool is_folder = false;
};

/// All arguments of exec, made before fork(): after it, nothing may be allocated.
struct Prepared {
  const Launch& launch;
  std::vector<char*> arguments{};
  std::vector<char*> environment{};
};

std::vector<char*> pointers_to(const std::vector<std::string>& texts) {
  std::vector<char*> pointers;
  pointers.reserve(texts.size() + 1);
  for (const std::string& text : texts)
    pointers.push_back(const_cast<char*>(text.c_str()));  // exec does not write to the text.
  pointers.push_back(nullptr);
  return pointers;
}

void reset_signals() {
  struct sigaction standard {};
  standard.sa_handler = SIG_DFL;
  for (int signal = 1; signal < NSIG; ++signal)
    ::sigaction(signal, &standard, nullptr);
  sigset_t none;
  ::sigemptyset(&none);
  ::sigprocmask(SIG_SETMASK, &none, nullptr);
}

/// Places descriptors as 0, 1 and 2; first moves them out of each other's way.
bool place_streams(const Launch& launch) {
  std::array<int, 3> streams{launch.input, launch.output, launch.errors};
  for (int& stream : streams) {
    if (stream < 0 || stream > STDERR_FILENO) continue;
    stream = ::fcntl(stream, F_DUPFD_CLOEXEC, STDERR_FILENO + 1);
    if (stream < 0) return false;
  }
  for (int i = 0; i < 3; ++i) {
    const int stream = streams[static_cast<std::size_t>(i)];
    if (stream >= 0 && ::dup2(stream, i) < 0) return false;
  }
  return true;
}

/// Runs in the new process. Async-signal-safe calls only.
[[noreturn]] void run(const Prepared& prepared, pid_t parent, int report) {
  const Launch& launch = prepared.launch;
  Failure failure;
  if (launch.has_own_group) ::setpgid(0, 0);
  reset_signals();
  ::prctl(PR_SET_PDEATHSIG, SIGTERM);
  if (::getppid() != parent) ::_exit(1);  // The parent ended before the line above.
  if (place_streams(launch)) {
    if (::chdir(launch.folder.c_str()) == 0) {
      ::close_range(STDERR_FILENO + 1, ~0U, CLOSE_RANGE_CLOEXEC);
      ::execve(launch.path.c_str(), prepared.arguments.data(), prepared.environment.data());
    } else {
      failure.is_folder = true;
    }
  }
  failure.number = errno;
  static_cast<void>(!::write(report, &failure, sizeof failure));
  ::_exit(127);
}

}  // namespace

void Handle::reset() noexcept {
  if (number_ >= 0) ::close(std::exchange(number_, -1));
}

expected<std::array<Handle, 2>, SetupError> make_pipe() {
  std::array<int, 2> ends{};
  if (::pipe2(ends.data(), O_CLOEXEC) != 0) {
    return setup_error("there is no pipe", system_error(errno), "raise the limit of open files");
  }
  return std::array<Handle, 2>{Handle(ends[0]), Handle(ends[1])};
}

expected<pid_t, SetupError> launch(const Launch& launch) {
  auto report = make_pipe();
  if (!report) return unexpected{report.error()};
  const Prepared prepared{launch, pointers_to(launch.arguments), pointers_to(launch.environment)};
  const pid_t parent = ::getpid();
  const pid_t id = ::fork();
  if (id < 0) return setup_error(launch.path + " does not start", system_error(errno));
  if (id == 0) run(prepared, parent, (*report)[1].number());
  // Both processes set the group, because either may run first.
  if (launch.has_own_group) ::setpgid(id, id);
  (*report)[1].reset();
  Failure failure;
  ssize_t size = 0;
  do {
    size = ::read((*report)[0].number(), &failure, sizeof failure);
  } while (size < 0 && errno == EINTR);
  if (size == 0) return id;  // exec has closed the other end.
  while (::waitpid(id, nullptr, 0) < 0 && errno == EINTR) {
  }
  const std::string what =
      failure.is_folder ? launch.folder + " can't be entered" : launch.path + " does not start";
  return setup_error(what, system_error(failure.number));
}

void leave_terminal() {
  const Handle nothing(::open("/dev/null", O_RDWR | O_CLOEXEC));
  for (const int stream : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO})
    ::dup2(nothing.number(), stream);
}

std::vector<std::string> environment_with(
    const std::vector<std::pair<std::string, std::string>>& changes) {
  std::vector<std::string> variables;
  for (char** variable = ::environ; *variable != nullptr; ++variable) {
    const std::string_view name =
        std::string_view(*variable).substr(0, std::string_view(*variable).find('='));
    if (std::ranges::none_of(changes, [&](const auto& change) { return change.first == name; }))
      variables.emplace_back(*variable);
  }
  for (const auto& [name, value] : changes) {
    std::string variable = name;
    variable += '=';
    variable += value;
    variables.push_back(std::move(variable));
  }
  return variables;
}

}  // namespace rtpm::laboratory
