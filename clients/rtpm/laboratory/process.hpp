#pragma once

#include <sys/types.h>

#include <array>
#include <string>
#include <utility>
#include <vector>

#include "rtpm/base/setup_error.hpp"

namespace rtpm::laboratory {

/// A file descriptor that is closed with it.
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
  std::vector<std::string> arguments{};    ///< Its name first.
  std::vector<std::string> environment{};  ///< "NAME=value".
  std::string folder{};
  int input = -1;  ///< In place of standard input; -1: this process's.
  int output = -1;
  int errors = -1;
  bool has_own_group = true;  ///< So that Ctrl-C at the terminal is this process's only.
};

/// Starts it: no signal blocked or ignored, no descriptor but the three. It gets SIGTERM when the
/// calling thread ends.
/// @threads  one that lasts as long as the program may
/// @errors   the system's, with what it is about
[[nodiscard]] expected<pid_t, SetupError> launch(const Launch& launch);

/// Puts /dev/null in place of this process's standard streams.
void leave_terminal();

/// The environment of this process, each variable of `changes` in place of the former.
[[nodiscard]] std::vector<std::string> environment_with(
    const std::vector<std::pair<std::string, std::string>>& changes);

}  // namespace rtpm::laboratory
