#pragma once

#include <grp.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <string>

/// Processes for actions that a test can't do to itself: losing its rights, or dying.
namespace rtpm::test {

/// Reads from the descriptor to its end and closes it.
[[nodiscard]] inline std::string read_all(int descriptor) {
  std::string text;
  std::array<char, 4096> part;
  while (true) {
    const ssize_t size = read(descriptor, part.data(), part.size());
    if (size < 0 && errno == EINTR) continue;
    if (size <= 0) break;
    text.append(part.data(), static_cast<std::size_t>(size));
  }
  close(descriptor);
  return text;
}

struct ChildResult {
  std::string said;    ///< The text that the body returned.
  std::string errors;  ///< Its output to standard error.
  int status = 0;      ///< The status that waitpid() returns.
};

/// Runs `body`, which returns a text, in a process of its own, and waits for its end.
template <class Body>
[[nodiscard]] ChildResult run_in_child(Body body) {
  std::array<int, 2> said{};
  std::array<int, 2> errors{};
  if (pipe(said.data()) != 0 || pipe(errors.data()) != 0) return {"no pipe", "", -1};
  const pid_t child = fork();
  if (child == 0) {
    dup2(errors[1], STDERR_FILENO);
    const std::string text = body();
    const ssize_t written = write(said[1], text.data(), text.size());
    _exit(written == static_cast<ssize_t>(text.size()) ? 0 : 1);
  }
  close(said[1]);
  close(errors[1]);
  ChildResult result;
  result.said = read_all(said[0]);
  result.errors = read_all(errors[0]);
  while (waitpid(child, &result.status, 0) < 0 && errno == EINTR) {
  }
  return result;
}

/// Gives up, for good, the rights to SCHED_FIFO and to lock more than `memory_lock_max` bytes.
inline void drop_realtime_rights(rlim_t memory_lock_max = 0) {
  const rlimit none{0, 0};
  setrlimit(RLIMIT_RTPRIO, &none);
  const rlimit memory{memory_lock_max, memory_lock_max};
  setrlimit(RLIMIT_MEMLOCK, &memory);
  if (geteuid() != 0) return;
  constexpr unsigned kNobody = 65534;
  const bool is_dropped =
      setgroups(0, nullptr) == 0 && setgid(kNobody) == 0 && setuid(kNobody) == 0;
  if (!is_dropped) _exit(2);
}

}  // namespace rtpm::test
