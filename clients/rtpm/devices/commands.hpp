#pragma once

#include <CLI/CLI.hpp>

#include "cli/context.hpp"

// Commands for devices.
namespace rtpm::tool {

void add_config(CLI::App& program, Context& context);
void add_take_over(CLI::App& program, Context& context);
void add_estop(CLI::App& program, Context& context);
void add_flight_record(CLI::App& program, Context& context);

}  // namespace rtpm::tool
