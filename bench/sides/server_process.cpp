#include "sides/server_process.hpp"

#include <poll.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cstdlib>
#include <utility>

namespace rtpm::bench {
namespace {

constexpr int kReadyTimeoutMs = 10'000;

std::string read_word(int pipe) {
  std::string word;
  pollfd waiting{.fd = pipe, .events = POLLIN, .revents = 0};
  std::array<char, 512> part{};
  while (poll(&waiting, 1, kReadyTimeoutMs) > 0) {
    const ssize_t size = read(pipe, part.data(), part.size());
    if (size <= 0) break;
    word.append(part.data(), static_cast<std::size_t>(size));
  }
  return word;
}

}  // namespace

Outcome<ServerProcess> ServerProcess::start(const SetUp& set_up) {
  return fork_with([&](int ready_pipe) {
    const auto outcome = set_up();
    const std::string word = outcome ? "+" + *outcome : "-" + outcome.error();
    const bool is_told = write(ready_pipe, word.data(), word.size()) > 0;
    close(ready_pipe);
    while (outcome && is_told)
      ::pause();
  });
}

Outcome<ServerProcess> ServerProcess::start_program(std::vector<std::string> command) {
  return fork_with([&](int ready_pipe) {
    std::vector<char*> arguments;
    for (std::string& argument : command)
      arguments.push_back(argument.data());
    arguments.push_back(nullptr);
    dup2(ready_pipe, STDOUT_FILENO);
    close(ready_pipe);
    execv(arguments[0], arguments.data());
  });
}

Outcome<ServerProcess> ServerProcess::fork_with(const std::function<void(int ready_pipe)>& body) {
  std::array<int, 2> ends{};
  if (pipe(ends.data()) != 0) return failure("no pipe for a server process");
  const pid_t parent = getpid();
  const pid_t child = fork();
  if (child < 0) return failure("a server process can't be forked");
  if (child == 0) {
    close(ends[0]);
    // The end of the parent kills this process; a parent that ended before that shows below.
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    if (getppid() != parent) _exit(1);
    body(ends[1]);
    _exit(1);
  }
  close(ends[1]);
  const std::string word = read_word(ends[0]);
  close(ends[0]);
  ServerProcess process(child, word.empty() ? "" : word.substr(1));
  if (word.starts_with('+')) return process;
  if (word.starts_with('-')) return failure(process.address_);
  return failure("a server process ended, or said nothing for 10 s");
}

ServerProcess::ServerProcess(ServerProcess&& other) noexcept
    : id_(std::exchange(other.id_, -1)), address_(std::move(other.address_)) {}

ServerProcess::~ServerProcess() {
  if (id_ < 0) return;
  kill(id_, SIGKILL);
  waitpid(id_, nullptr, 0);
}

void ServerProcess::pause() const noexcept {
  kill(id_, SIGSTOP);
  int status = 0;
  // Waits until it has really stopped; otherwise its last turns would run into the other's stretch.
  while (waitpid(id_, &status, WUNTRACED) == id_ && !WIFSTOPPED(status)) {
    if (WIFEXITED(status) || WIFSIGNALED(status)) return;
  }
}

void ServerProcess::resume() const noexcept {
  kill(id_, SIGCONT);
}

}  // namespace rtpm::bench
