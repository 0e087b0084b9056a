#pragma once

#include <span>
#include <string>
#include <variant>
#include <vector>

namespace rtpm::schema {

/// What rtpmc was asked to do.
struct Command {
  std::vector<std::string> include_paths{};
  std::string output_folder{};
  std::string dependency_file{};  ///< Empty: none.
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

}  // namespace rtpm::schema
