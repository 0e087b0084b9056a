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
  std::vector<std::string> choices{};  ///< Any value if empty.
  bool is_positional = false;
  bool is_required = false;
  bool is_list = false;
};

/// A command with its subcommands.
struct CommandFacts {
  std::string path;  ///< "config list"; empty for the program itself.
  std::string name;
  std::string summary;
  std::string details;
  std::vector<OptionFacts> options{};
  std::vector<CommandFacts> commands{};

  /// Whether an argument is an object's name.
  [[nodiscard]] bool takes_name() const;
  /// Whether an argument or an option's value is a file's name.
  [[nodiscard]] bool takes_file() const;
};

/// The program's commands and options.
[[nodiscard]] CommandFacts facts_of(const CLI::App& program);

/// A command and all its subcommands, in order.
[[nodiscard]] std::vector<const CommandFacts*> flattened(const CommandFacts& command);

}  // namespace rtpm::tool
