#pragma once

#include <span>
#include <string>
#include <variant>
#include <vector>

namespace rtpm::schema {

/// The arguments of rtpmc.
struct Command {
  bool is_check = false;  ///< The command is check: nothing is generated.
  std::vector<std::string> include_paths{};
  std::vector<std::string> languages{};  ///< Names of back ends; if empty, only checks.
  std::string output_folder{};           ///< If empty, prints a single file to standard output.
  std::string dependency_file{};         ///< Empty for none.
  std::string conform{};                 ///< The older schema; empty for none.
  bool is_strict = false;  ///< Treats changes that require updating servers first as errors.
  std::string schema{};
};

/// An invalid command line, as one sentence with the remedy.
struct UsageError {
  std::string text{};
};

/// The text for --help or --version; rtpmc then ends successfully.
struct Answer {
  std::string text{};
};

/// Parses the arguments after the program's name.
[[nodiscard]] std::variant<Command, UsageError, Answer> read_command_line(
    std::span<const char* const> arguments, const std::string& version);

/// The folder of RTPM's own schemas: next to an installed rtpmc, otherwise in the source tree that
/// it was built from. Empty if neither exists.
[[nodiscard]] std::string idl_folder();

}  // namespace rtpm::schema
