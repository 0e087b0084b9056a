#pragma once

#include <CLI/CLI.hpp>

#include "cli/context.hpp"

// Commands for events.
namespace rtpm::tool {

void add_echo(CLI::App& program, Context& context);
void add_pub(CLI::App& program, Context& context);
void add_mark(CLI::App& program, Context& context);
void add_hz(CLI::App& program, Context& context);
void add_consumers(CLI::App& program, Context& context);
void add_incidents(CLI::App& program, Context& context);

}  // namespace rtpm::tool
