#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

namespace rtpm::tool {

/// An option or argument, as completion and manual page show it.
struct OptionFacts {
  std::string name;   ///< "--json", "TARGET".
  std::string value;  ///< "TIME"; empty for a flag or an argument.
  std::string help;
  std::vector<std::string> choices{};  ///< If empty, any value.
  bool is_positional = false;
  bool is_required = false;
  bool is_list = false;
};

/// A command with its subcommands.
struct CommandFacts {
  std::string path;  ///< Such as "config list"; empty for the program itself.
  std::string name;
  std::string summary;
  std::string details;
  std::vector<OptionFacts> options{};
  std::vector<CommandFacts> commands{};

  /// Whether one of its arguments is an object's name.
  [[nodiscard]] bool takes_name() const;
  /// Whether one of its arguments or option values is a file name.
  [[nodiscard]] bool takes_file() const;
};

/// The program's commands and options.
[[nodiscard]] CommandFacts facts_of(const CLI::App& program);

/// A command and all its subcommands, in order.
[[nodiscard]] std::vector<const CommandFacts*> flattened(const CommandFacts& command);

}  // namespace rtpm::tool
