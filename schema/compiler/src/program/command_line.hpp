#pragma once

#include <span>
#include <string>
#include <variant>
#include <vector>

namespace rtpm::schema {

/// The arguments of rtpmc.
struct Command {
  bool is_check = false;  ///< The verb check: nothing is generated.
  std::vector<std::string> include_paths{};
  std::vector<std::string> languages{};  ///< Names of back ends; empty to check only.
  std::string output_folder{};           ///< If empty, standard output, for a single file.
  std::string dependency_file{};         ///< Empty if none.
  std::string conform{};                 ///< The older schema; empty if there is none.
  bool is_strict = false;                ///< A need to update servers first is an error.
  std::string schema{};
};

/// A wrong command line, in one sentence with the remedy.
struct UsageError {
  std::string text{};
};

/// The text to print for --help or --version; rtpmc then ends with success.
struct Answer {
  std::string text{};
};

/// Parses the arguments after the program's name.
[[nodiscard]] std::variant<Command, UsageError, Answer> read_command_line(
    std::span<const char* const> arguments, const std::string& version);

/// The folder of RTPM's own schemas: beside an installed rtpmc, otherwise in the source tree that
/// it was built from. Empty if neither exists.
[[nodiscard]] std::string idl_folder();

}  // namespace rtpm::schema
