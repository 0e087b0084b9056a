#pragma once

#include <CLI/CLI.hpp>

#include "cli/context.hpp"

// Commands for recordings.
namespace rtpm::tool {

void add_record(CLI::App& program, Context& context);
void add_play(CLI::App& program, Context& context);
/// `rtpm bag export`.
void add_export(CLI::App& group, Context& context);
void add_bag(CLI::App& program, Context& context);

}  // namespace rtpm::tool
