#pragma once

#include <sys/types.h>

#include <array>
#include <string>
#include <utility>
#include <vector>

#include "rtpm/base/setup_error.hpp"

namespace rtpm::laboratory {

/// Owns a file descriptor and closes it.
class Handle {
 public:
  explicit Handle(int number = -1) noexcept : number_(number) {}
  Handle(Handle&& other) noexcept : number_(std::exchange(other.number_, -1)) {}
  Handle& operator=(Handle&& other) noexcept {
    std::swap(number_, other.number_);
    return *this;
  }
  ~Handle() { reset(); }
  void reset() noexcept;
  [[nodiscard]] int number() const noexcept { return number_; }
  [[nodiscard]] bool is_open() const noexcept { return number_ >= 0; }

 private:
  int number_;
};

/// Both ends of a pipe, the reading one first, closed at exec.
[[nodiscard]] expected<std::array<Handle, 2>, SetupError> make_pipe();

/// A program to be started.
struct Launch {
  std::string path{};
  std::vector<std::string> arguments{};    ///< The program's name comes first.
  std::vector<std::string> environment{};  ///< "NAME=value".
  std::string folder{};
  int input = -1;  ///< Standard input; -1 to inherit this process's.
  int output = -1;
  int errors = -1;
  bool has_own_group = true;  ///< Ctrl-C at the terminal then reaches only this process.
};

/// Starts the program without blocked or ignored signals, with the three descriptors only. The
/// system sends it SIGTERM when the calling thread ends.
/// @threads  one that lasts at least as long as the program
/// @errors   the system's error, with the failed step
[[nodiscard]] expected<pid_t, SetupError> launch(const Launch& launch);

/// Replaces this process's standard streams by /dev/null.
void leave_terminal();

/// This process's environment, with the variables of `changes` replaced or added.
[[nodiscard]] std::vector<std::string> environment_with(
    const std::vector<std::pair<std::string, std::string>>& changes);

}  // namespace rtpm::laboratory
