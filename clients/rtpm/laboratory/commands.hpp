#pragma once

#include <CLI/CLI.hpp>

#include "cli/context.hpp"
#include "laboratory/plan.hpp"

// Commands that start laboratories: programs that run together on this host.
namespace rtpm::tool {

void add_up(CLI::App& program, Context& context);
void add_down(CLI::App& program, Context& context);
void add_demo(CLI::App& program, Context& context);
void add_ros2(CLI::App& program, Context& context);

/// Starts a laboratory and displays it, until it is asked to end or its main programs have ended.
/// @param plan  or the mistakes in its file, which are reported
/// @param is_detached  return once everything serves
/// @threads  call it before any other thread starts
/// @return the exit code
[[nodiscard]] int bring_up(Context& context,
                           const expected<laboratory::Plan, std::vector<SetupError>>& plan,
                           bool is_detached = false);

/// Starts, watches and ends the programs of a laboratory, and displays their state. When it
/// returns, no program is running.
/// @param has_terminal  programs may use the terminal
/// @param report  a descriptor that receives a byte once everything serves, or -1
/// @return the exit code
[[nodiscard]] int supervise(Context& context, const laboratory::Plan& plan, bool has_terminal,
                            int report);

}  // namespace rtpm::tool
