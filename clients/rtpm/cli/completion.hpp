#pragma once

#include <CLI/CLI.hpp>
#include <string>

#include "cli/command_tree.hpp"
#include "cli/context.hpp"

namespace rtpm::tool {

/// Scripts with which shells complete the program's commands, options, choices and names.
[[nodiscard]] std::string bash_completion(const CommandFacts& program);
[[nodiscard]] std::string zsh_completion(const CommandFacts& program);
[[nodiscard]] std::string fish_completion(const CommandFacts& program);

void add_completion(CLI::App& program, Context& context);

}  // namespace rtpm::tool
