#pragma once

#include <CLI/CLI.hpp>
#include <memory>

#include "cli/context.hpp"

namespace rtpm::tool {

/// Creates the program with all its commands. Parsed options go to `context`.
[[nodiscard]] std::unique_ptr<CLI::App> make_program(Context& context);

/// Parses the command line and runs its command.
/// @return the exit code
[[nodiscard]] int run_program(CLI::App& program, Context& context, int argc,
                              const char* const* argv);

}  // namespace rtpm::tool
