#pragma once

#include <signal.h>

#include <array>
#include <functional>
#include <optional>
#include <string>
#include <string_view>

#include "laboratory/plan.hpp"
#include "rtpm/base/setup_error.hpp"
#include "rtpm/transport/socket.hpp"

namespace rtpm::laboratory {

/// A program's process; its standard output and error are read here.
struct Process {
  struct Stream {
    transport::Descriptor descriptor{};
    std::string text{};  ///< The beginning of a line.
  };
  pid_t id = 0;
  std::array<Stream, 2> streams{};
};

/// Starts a program, without blocked or ignored signals, in its own process group.
/// @param arguments     the program's name first
/// @param environment   replaces this process's variables
/// @param has_terminal  it uses this process's group and standard streams instead
/// @errors   the system's error
[[nodiscard]] expected<Process, SetupError> launch(const std::string& path, Words arguments,
                                                   const Variables& environment,
                                                   const std::string& folder, bool has_terminal);

/// Passes on the lines that have arrived; if it has ended, also an incomplete last line.
void read_lines(Process::Stream& stream, bool has_ended,
                const std::function<void(std::string_view line)>& take);

/// Makes this process the parent of its orphaned descendants, and blocks the returned signals: the
/// stop signals and SIGCHLD.
sigset_t become_parent();

/// Ends all children of this process and, after become_parent(), their descendants: SIGTERM, then
/// SIGKILL after `patience`.
/// @return whether all have ended within 2 s after SIGKILL
bool end_children(Duration patience);

/// Runs `work` in a child process, and passes stop signals on to it. If this process is killed, the
/// child gets SIGTERM; if the child is killed, end_children() ends its descendants.
/// @return the exit code; nullopt if the work was killed
/// @threads  call it before any other thread starts
/// @errors   the system's error
[[nodiscard]] expected<std::optional<int>, SetupError> run_guarded(const std::function<int()>& work,
                                                                   Duration patience);

}  // namespace rtpm::laboratory
