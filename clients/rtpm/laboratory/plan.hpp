#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/base/time.hpp"

namespace rtpm::laboratory {

using Words = std::vector<std::string>;
using Indices = std::vector<std::size_t>;
/// Values by name, either of `${NAME}` or of environment variables.
using Variables = std::map<std::string, std::string>;

/// Shows a program's output at once, only its standard error, or all when the laboratory has ended;
/// or the program has the terminal.
enum class Output : std::uint8_t { kLines, kErrors, kEnd, kTerminal };

/// A program of a laboratory, as described by its file. The program serves once it has printed its
/// line and its URL and its names are bound, as far as the file requires this.
struct ProgramPlan {
  std::string name{};
  std::string path{};       ///< The path of the executable.
  Words command{};          ///< May contain variables, see expanded().
  Variables environment{};  ///< The values may contain variables, see expanded().
  Indices after{};          ///< Programs that must serve before this one starts.
  Indices uses{};           ///< The programs in `after` whose URL it uses.
  std::string ready_line{};
  Words names{};
  bool must_print_url = false;
  bool is_one_shot = false;  ///< It serves once it has ended with exit code 0.
  Duration ready_deadline = std::chrono::seconds{10};
  bool is_restarted = false;  ///< Restarted when it fails.
  Duration stop_patience = std::chrono::seconds{2};
  Output output = Output::kLines;
  bool is_main = false;    ///< The laboratory ends when all main programs have ended.
  bool is_needed = false;  ///< The laboratory ends when this program fails.
};

/// A laboratory: programs that run together on one host.
struct Plan {
  std::string name{};
  std::string file{};
  std::string folder{};                 ///< The file's folder, in which all programs run.
  Variables variables{};                ///< "NAME.url" is empty until the program NAME serves.
  std::vector<ProgramPlan> programs{};  ///< In the order of the file.
  Indices order{};                      ///< The order in which they start.
  Words left_out{};                     ///< Optional programs that are not installed.
};

/// The folder of this program, then those of PATH.
[[nodiscard]] Words program_folders();

/// Reads a laboratory file.
/// @param variables  replace those in the file
/// @param folders    searched for programs, in this order
/// @errors   "cell.toml:3:8: …", one for each mistake, in the order of the file; the file can't be
///           read
[[nodiscard]] expected<Plan, std::vector<SetupError>> read_plan(
    const std::string& path, const Variables& variables = {},
    const Words& folders = program_folders());

/// Replaces the variables in `text`: ${NAME}, ${environment.NAME}. $$ means one $.
/// @param used  receives the names that occur; may be null
/// @errors   the mistake, as a clause
[[nodiscard]] expected<std::string, std::string> expanded(std::string_view text,
                                                          const Variables& variables,
                                                          Words* used = nullptr);

}  // namespace rtpm::laboratory
