#pragma once

#include <CLI/CLI.hpp>

#include "cli/context.hpp"

namespace rtpm::tool {

void add_version(CLI::App& program, Context& context);

}  // namespace rtpm::tool
