#pragma once

#include <span>
#include <string>
#include <variant>
#include <vector>

namespace rtpm::schema {

/// What rtpmc was asked to do.
struct Command {
  bool is_check = false;  ///< The verb check: nothing is generated.
  std::vector<std::string> include_paths{};
  std::vector<std::string> languages{};  ///< Names of back ends; none to check.
  std::string output_folder{};           ///< Empty: standard output, of one file.
  std::string dependency_file{};         ///< Empty: none.
  std::string conform{};                 ///< The older schema; empty: none.
  bool is_strict = false;                ///< Also what needs the servers first is an error.
  std::string schema{};
};

/// A wrong command line, in one sentence with the remedy.
struct UsageError {
  std::string text{};
};

/// --help or --version: print this and end well.
struct Answer {
  std::string text{};
};

/// Reads the arguments behind the program's name.
[[nodiscard]] std::variant<Command, UsageError, Answer> read_command_line(
    std::span<const char* const> arguments, const std::string& version);

/// Where RTPM's own schemas are: beside an installed rtpmc, else in the tree that it was built
/// from. Empty: in neither place.
[[nodiscard]] std::string idl_folder();

}  // namespace rtpm::schema
