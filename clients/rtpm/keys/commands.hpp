#pragma once

#include <CLI/CLI.hpp>

#include "cli/context.hpp"

// Keys, known servers and grants: `rtpm key …`.
namespace rtpm::tool {

void add_key(CLI::App& program, Context& context);

}  // namespace rtpm::tool
