#pragma once

#include <array>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "laboratory/plan.hpp"
#include "laboratory/process.hpp"

namespace rtpm::laboratory {

/// One run of a program: its process, and the lines that it prints.
/// @threads  one
class RunningProgram {
 public:
  /// Receives a line without its end.
  using TakeLine = std::function<void(bool is_error, std::string_view line)>;

  /// @param has_terminal  the program may use the terminal, if its plan says so
  [[nodiscard]] static expected<RunningProgram, SetupError> start(
      const ProgramPlan& plan, const std::vector<std::string>& urls,
      const std::string& registry_url, bool has_terminal);

  [[nodiscard]] int process() const noexcept { return process_; }
  /// Descriptors of standard output and standard error to read; -1 if ended or not read.
  [[nodiscard]] std::array<int, 2> streams() const noexcept;
  /// Reads all complete lines that have arrived, at most 64 KiB of each stream.
  void read(const TakeLine& take);
  /// Reads everything that has arrived, including a last line without an end.
  void read_rest(const TakeLine& take);

  /// Signals its process and the processes that it has started.
  void send_signal(int signal) const;

 private:
  struct Stream {
    Handle handle{};
    std::string text{};
  };
  RunningProgram() = default;
  static void read_stream(Stream& stream, bool is_error, const TakeLine& take);

  int process_ = 0;
  bool has_own_group_ = true;
  std::array<Stream, 2> streams_{};
};

}  // namespace rtpm::laboratory
