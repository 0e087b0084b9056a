#pragma once

#include <CLI/CLI.hpp>

#include "cli/context.hpp"

// Commands that inspect servers, and call their objects.
namespace rtpm::tool {

void add_list(CLI::App& program, Context& context);
void add_info(CLI::App& program, Context& context);
void add_stubs(CLI::App& program, Context& context);
void add_find(CLI::App& program, Context& context);
void add_bind(CLI::App& program, Context& context);
void add_unbind(CLI::App& program, Context& context);
void add_resolve(CLI::App& program, Context& context);
void add_watch(CLI::App& program, Context& context);
void add_ping(CLI::App& program, Context& context);
void add_call(CLI::App& program, Context& context);

}  // namespace rtpm::tool
