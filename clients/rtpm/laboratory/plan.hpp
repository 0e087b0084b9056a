#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "rtpm/base/time.hpp"

namespace rtpm::laboratory {

/// Text with parts that become known when another program serves: "--registry=${registry.url}".
class Text {
 public:
  Text() = default;
  explicit Text(std::string literal);

  void append(std::string literal);
  /// Appends a reference to that program's URL.
  void append_url_of(std::size_t program);

  [[nodiscard]] std::vector<std::size_t> programs() const;
  /// @param urls  the URLs of all programs, in the order of the file
  [[nodiscard]] std::string resolved(const std::vector<std::string>& urls) const;

 private:
  struct Piece {
    std::string literal{};
    std::optional<std::size_t> url_of{};
  };
  std::vector<Piece> pieces_{};
};

/// The condition under which a program counts as serving.
enum class Readiness : std::uint8_t {
  kStart,  ///< At once.
  kUrl,    ///< At the first line of standard output that has "rtpm://".
  kLine,   ///< At the first line that has `ready_line`.
  kNames,  ///< When all of `names` are bound at the registry.
  kExit,   ///< When it has ended with exit code 0.
};

enum class Restart : std::uint8_t { kNever, kOnFailure, kAlways };

/// The treatment of a program's output.
enum class Output : std::uint8_t {
  kLines,     ///< Shown at once, after the program's name.
  kErrors,    ///< Like kLines, but standard error only.
  kEnd,       ///< Shown when the laboratory has ended.
  kTerminal,  ///< The program has the terminal.
  kNone,
};

/// A program of a laboratory, as its file describes it.
struct ProgramPlan {
  std::string name{};
  std::string path{};  ///< The path of the executable.
  std::vector<Text> command{};
  std::vector<std::pair<std::string, Text>> environment{};
  std::string folder{};
  std::vector<std::size_t> after{};  ///< Programs that must serve before this one starts.
  std::vector<std::size_t> uses{};   ///< Those of `after` whose URL it is given.
  Readiness readiness = Readiness::kStart;
  std::string ready_line{};
  std::vector<std::string> names{};
  bool has_url = false;  ///< Another program is given its URL, so it must print one.
  Duration ready_deadline = std::chrono::seconds{10};
  Restart restart = Restart::kNever;
  /// Restarts within `restart_window`; with more, the program has failed.
  std::size_t restart_limit = 5;
  Duration restart_window = std::chrono::minutes{1};
  /// The delay of the first restart; it doubles with each further one.
  Duration restart_delay = std::chrono::milliseconds{200};
  Duration restart_delay_max = std::chrono::seconds{10};
  int stop_signal = 15;
  Duration stop_patience = std::chrono::seconds{2};
  Output output = Output::kLines;
  bool is_main = false;    ///< The laboratory ends when all main programs have ended.
  bool is_needed = false;  ///< The laboratory ends when this program has failed.
};

/// A laboratory: programs that run together on one host.
struct Plan {
  std::string name{};
  std::string file{};
  std::string log_folder{};  ///< No files if empty.
  std::optional<std::size_t> registry_program{};
  std::string registry_url{};  ///< Used without a registry program; if empty, the caller's.
  std::vector<ProgramPlan> programs{};  ///< Sorted as in the file.
  std::vector<std::size_t> order{};     ///< The order of start.
  std::vector<std::string> left_out{};  ///< Optional programs that are not installed.

  [[nodiscard]] bool has_terminal() const;
  /// The longest time of an orderly end, for all programs one after the other.
  [[nodiscard]] Duration stop_patience() const;
  /// The longest time that a single program may take to end.
  [[nodiscard]] Duration longest_stop_patience() const;
};

/// The environment variable with the registry's URL.
inline constexpr const char* kRegistryVariable = "RTPM_REGISTRY";
/// The environment variable that says how names are found without a registry.
inline constexpr const char* kDiscoverVariable = "RTPM_DISCOVER";

/// Adds implicit dependencies: a program comes after each program whose URL it is given, and uses
/// it; all programs that the registry does not come after are given the registry's URL.
void connect(Plan& plan);

/// The order of start: each program after those in its `after`, otherwise the file's order.
/// @return empty if programs wait for each other; `cycle` then has them
[[nodiscard]] std::vector<std::size_t> start_order(const std::vector<ProgramPlan>& programs,
                                                   std::vector<std::size_t>& cycle);

/// Whether `program` starts only after `other`, directly or indirectly.
[[nodiscard]] bool comes_after(const std::vector<ProgramPlan>& programs, std::size_t program,
                               std::size_t other);

}  // namespace rtpm::laboratory
