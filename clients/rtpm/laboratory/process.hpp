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

/// A program's process, and its standard output and error, which are read.
struct Process {
  struct Stream {
    transport::Descriptor descriptor{};
    std::string text{};  ///< The begin of a line.
  };
  pid_t id = 0;
  std::array<Stream, 2> streams{};
};

/// Starts a program, without blocked or ignored signals, in a group of its own.
/// @param arguments     the program's name first
/// @param environment   replaces this process's variables
/// @param has_terminal  it has this process's group and standard streams instead
/// @errors   the system's error
[[nodiscard]] expected<Process, SetupError> launch(const std::string& path, Words arguments,
                                                   const Variables& environment,
                                                   const std::string& folder, bool has_terminal);

/// Passes on the lines that have arrived and, if it has ended, the begin of a line.
void read_lines(Process::Stream& stream, bool has_ended,
                const std::function<void(std::string_view line)>& take);

/// Makes this process the parent of its orphaned descendants, and blocks the returned signals:
/// those to stop, and SIGCHLD.
sigset_t become_parent();

/// Ends all children of this process and, as become_parent() makes them its children, their
/// descendants: SIGTERM, then SIGKILL after `patience`.
/// @return whether all have ended, within 2 s of SIGKILL
bool end_children(Duration patience);

/// Runs `work` in a child process, and passes stop signals on to it. If this process is killed, the
/// child gets SIGTERM; if the child is killed, its descendants end by end_children().
/// @return the exit code; nullopt if the work was killed
/// @threads  before any other thread starts
/// @errors   the system's error
[[nodiscard]] expected<std::optional<int>, SetupError> run_guarded(const std::function<int()>& work,
                                                                   Duration patience);

}  // namespace rtpm::laboratory
