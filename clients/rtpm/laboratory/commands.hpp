#pragma once

#include <CLI/CLI.hpp>

#include "cli/context.hpp"

// Commands that bring up laboratories: programs that run together on this host.
namespace rtpm::tool {

void add_up(CLI::App& program, Context& context);
void add_down(CLI::App& program, Context& context);
void add_demo(CLI::App& program, Context& context);

}  // namespace rtpm::tool
