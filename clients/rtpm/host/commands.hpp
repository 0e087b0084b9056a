#pragma once

#include <CLI/CLI.hpp>

#include "cli/context.hpp"

// Commands about this host.
namespace rtpm::tool {

void add_lanes(CLI::App& program, Context& context);
void add_clocks(CLI::App& program, Context& context);
void add_top(CLI::App& program, Context& context);
void add_doctor(CLI::App& program, Context& context);

}  // namespace rtpm::tool
