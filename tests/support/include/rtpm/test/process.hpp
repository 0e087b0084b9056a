#pragma once

#include <sys/types.h>

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/base/time.hpp"

namespace rtpm::test {

/// A program that a test runs, with its output; killed with this object at the latest. It has the
/// test's environment without RTPM_… variables and an empty standard input. It finds only this
/// test's programs by name, in the test's own RTPM_RUNTIME_FOLDER if there is one; its keys are in
/// RTPM_KEYS, or in that folder.
/// Threads: one.
class Process {
 public:
  /// How a program ended.
  struct End {
    std::optional<int> exit_code{};  ///< nullopt if a signal ended it.
    std::string output;
    std::string errors;
  };

  /// Starts `command`, the program's path first. A program that can't be started ends the test
  /// binary: it was not built.
  explicit Process(const std::vector<std::string>& command);
  Process(Process&& other) noexcept;
  Process& operator=(Process&& other) noexcept;
  ~Process();

  /// Reads on until standard output has `text`; false if it ends, or `patience` is over, before.
  [[nodiscard]] bool wait_for_output(std::string_view text, Duration patience);
  /// Like wait_for_output(), but for standard error.
  [[nodiscard]] bool wait_for_errors(std::string_view text, Duration patience);
  /// Waits until the program ends; nullopt if it does not within `patience`.
  [[nodiscard]] std::optional<End> wait(Duration patience);
  void send_signal(int signal) const;
  /// Stops the program by SIGSTOP, and waits until the system has done so.
  void stop() const;

  /// The program's output, as far as it was read.
  [[nodiscard]] const std::string& output() const noexcept { return output_.text; }
  [[nodiscard]] const std::string& errors() const noexcept { return errors_.text; }

 private:
  /// One end of a pipe and the bytes read from it.
  struct Stream {
    int handle = -1;
    std::string text;
  };
  void read_for(Duration patience);
  static void take(Stream& stream);
  void release() noexcept;

  pid_t id_ = -1;
  Stream output_{};
  Stream errors_{};
};

/// Runs `command` to its end; nullopt if it does not end within `patience`.
[[nodiscard]] std::optional<Process::End> run(const std::vector<std::string>& command,
                                              Duration patience);

/// The number of lines in `text`.
[[nodiscard]] int line_count(std::string_view text);

}  // namespace rtpm::test
