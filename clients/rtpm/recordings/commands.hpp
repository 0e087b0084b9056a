#pragma once

#include <CLI/CLI.hpp>
#include <string>

#include "cli/context.hpp"

// Commands for recordings.
namespace rtpm::tool {

void add_record(CLI::App& program, Context& context);
void add_play(CLI::App& program, Context& context);
/// Cuts the pictures and the sound of a recorded camera out.
/// @param medium  empty: the only one
/// @return the exit code
[[nodiscard]] int export_video(Context& context, const std::string& file, const std::string& output,
                               const std::string& medium);
/// `rtpm bag export`.
void add_export(CLI::App& group, Context& context);
void add_bag(CLI::App& program, Context& context);

}  // namespace rtpm::tool
