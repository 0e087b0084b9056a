#pragma once

#include <CLI/CLI.hpp>
#include <string>

#include "cli/command_tree.hpp"
#include "cli/context.hpp"

namespace rtpm::tool {

/// The manual page, section 1, in roff.
[[nodiscard]] std::string manual_page(const CommandFacts& program);

void add_manual(CLI::App& program, Context& context);

}  // namespace rtpm::tool
