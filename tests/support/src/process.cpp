#include "rtpm/test/process.hpp"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <system_error>
#include <utility>

namespace rtpm::test {
namespace {

using Clock = std::chrono::steady_clock;

/// The pointers into `texts` that exec takes.
std::vector<char*> pointers_to(std::vector<std::string>& texts) {
  std::vector<char*> pointers;
  pointers.reserve(texts.size() + 1);
  for (std::string& text : texts)
    pointers.push_back(text.data());
  pointers.push_back(nullptr);
  return pointers;
}

/// A folder that is removed with the test's process.
const std::string& folder_of_this_test() {
  struct Folder {
    std::string path = std::filesystem::temp_directory_path() / "rtpm-test-XXXXXX";
    Folder() {
      if (mkdtemp(path.data()) == nullptr) std::abort();
    }
    ~Folder() {
      std::error_code ignored;
      std::filesystem::remove_all(path, ignored);
    }
  };
  static const Folder folder;
  return folder.path;
}

/// "NAME=VALUE" from this process's environment, or a folder of this test's own.
std::string with_folder(const char* variable) {
  const char* const own = std::getenv(variable);
  return std::string(variable) + "=" + (own != nullptr ? std::string(own) : folder_of_this_test());
}

std::vector<std::string> clean_environment() {
  // In the first folder, programs find each other, but not this host's other programs; the other
  // folders hold their keys and their state.
  std::vector<std::string> variables{with_folder("RTPM_RUNTIME_FOLDER"), with_folder("RTPM_KEYS"),
                                     with_folder("XDG_STATE_HOME")};
  for (char** variable = environ; *variable != nullptr; ++variable) {
    const std::string_view entry = *variable;
    if (!entry.starts_with("RTPM_") && !entry.starts_with("XDG_STATE_HOME="))
      variables.emplace_back(*variable);
  }
  return variables;
}

std::array<int, 2> make_pipe() {
  std::array<int, 2> ends{};
  if (pipe2(ends.data(), O_CLOEXEC | O_NONBLOCK) != 0) std::abort();
  // The program's own end of the pipe blocks, as programs expect.
  fcntl(ends[1], F_SETFL, 0);
  return ends;
}

pid_t spawn(const std::vector<std::string>& command, int output, int errors) {
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_adddup2(&actions, output, STDOUT_FILENO);
  posix_spawn_file_actions_adddup2(&actions, errors, STDERR_FILENO);
  // This test's own program ignores them.
  sigset_t signals;
  sigemptyset(&signals);
  for (const int signal : {SIGPIPE, SIGXFSZ})
    sigaddset(&signals, signal);
  posix_spawnattr_t attributes;
  posix_spawnattr_init(&attributes);
  posix_spawnattr_setsigdefault(&attributes, &signals);
  posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSIGDEF);
  std::vector<std::string> arguments = command;
  std::vector<std::string> variables = clean_environment();
  pid_t id = -1;
  const int error = posix_spawnp(&id, command.front().c_str(), &actions, &attributes,
                                 pointers_to(arguments).data(), pointers_to(variables).data());
  posix_spawnattr_destroy(&attributes);
  posix_spawn_file_actions_destroy(&actions);
  if (error != 0) {
    std::fprintf(stderr, "the program %s can't be started: %s\n", command.front().c_str(),
                 std::strerror(error));
    std::abort();
  }
  return id;
}

int milliseconds_until(Clock::time_point end) {
  const auto left = std::chrono::ceil<std::chrono::milliseconds>(end - Clock::now()).count();
  return static_cast<int>(std::clamp<decltype(left)>(left, 0, 60'000));
}

}  // namespace

Process::Process(const std::vector<std::string>& command) {
  const auto output = make_pipe();
  const auto errors = make_pipe();
  id_ = spawn(command, output[1], errors[1]);
  close(output[1]);
  close(errors[1]);
  output_.handle = output[0];
  errors_.handle = errors[0];
}

Process::Process(Process&& other) noexcept
    : id_(std::exchange(other.id_, -1)),
      output_(std::exchange(other.output_, {})),
      errors_(std::exchange(other.errors_, {})) {}

Process& Process::operator=(Process&& other) noexcept {
  std::swap(id_, other.id_);
  std::swap(output_, other.output_);
  std::swap(errors_, other.errors_);
  return *this;
}

Process::~Process() {
  if (id_ > 0) {
    kill(id_, SIGKILL);
    waitpid(id_, nullptr, 0);
  }
  release();
}

void Process::release() noexcept {
  for (Stream* stream : {&output_, &errors_}) {
    if (stream->handle >= 0) close(stream->handle);
    stream->handle = -1;
  }
}

void Process::take(Stream& stream) {
  std::array<char, 4096> part{};
  for (;;) {
    const ssize_t size = read(stream.handle, part.data(), part.size());
    if (size > 0) {
      stream.text.append(part.data(), static_cast<std::size_t>(size));
      continue;
    }
    if (size < 0 && (errno == EAGAIN || errno == EINTR)) return;
    close(stream.handle);
    stream.handle = -1;
    return;
  }
}

/// Reads the next bytes, or nothing within `patience`.
void Process::read_for(Duration patience) {
  const auto end = Clock::now() + patience;
  // poll() skips negative handles; streams that have ended have them.
  std::array<pollfd, 2> waiting{{{.fd = output_.handle, .events = POLLIN, .revents = 0},
                                 {.fd = errors_.handle, .events = POLLIN, .revents = 0}}};
  poll(waiting.data(), waiting.size(), milliseconds_until(end));
  if (waiting[0].revents != 0) take(output_);
  if (waiting[1].revents != 0) take(errors_);
}

bool Process::wait_for_output(std::string_view text, Duration patience) {
  const auto end = Clock::now() + patience;
  while (output_.text.find(text) == std::string::npos) {
    if (output_.handle < 0 || Clock::now() >= end) return false;
    read_for(end - Clock::now());
  }
  return true;
}

bool Process::wait_for_errors(std::string_view text, Duration patience) {
  const auto end = Clock::now() + patience;
  while (errors_.text.find(text) == std::string::npos) {
    if (errors_.handle < 0 || Clock::now() >= end) return false;
    read_for(end - Clock::now());
  }
  return true;
}

std::optional<Process::End> Process::wait(Duration patience) {
  const auto end = Clock::now() + patience;
  while (output_.handle >= 0 || errors_.handle >= 0) {
    if (Clock::now() >= end) return std::nullopt;
    read_for(end - Clock::now());
  }
  // Both streams have ended, so the program is ending.
  int status = 0;
  waitpid(id_, &status, 0);
  id_ = -1;
  End how{.output = output_.text, .errors = errors_.text};
  if (WIFEXITED(status)) how.exit_code = WEXITSTATUS(status);
  return how;
}

void Process::stop() const {
  send_signal(SIGSTOP);
  int status = 0;
  while (waitpid(id_, &status, WUNTRACED) < 0 && errno == EINTR) {
  }
}

void Process::send_signal(int signal) const {
  // Other numbers are groups, this test's own among them.
  if (id_ > 0) kill(id_, signal);
}

std::optional<Process::End> run(const std::vector<std::string>& command, Duration patience) {
  return Process(command).wait(patience);
}

int line_count(std::string_view text) {
  return static_cast<int>(std::count(text.begin(), text.end(), '\n'));
}

}  // namespace rtpm::test
