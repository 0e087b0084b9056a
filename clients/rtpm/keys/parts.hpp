#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

#include "cli/context.hpp"
#include "rtpm/access/authorized.hpp"

// The commands of `rtpm key`, and what several of them use.
namespace rtpm::tool {

void add_key_new(CLI::App& group, Context& context);
void add_key_show(CLI::App& group, Context& context);
void add_key_learn(CLI::App& group, Context& context);
void add_key_forget(CLI::App& group, Context& context);
void add_key_authorize(CLI::App& group, Context& context);
void add_key_revoke(CLI::App& group, Context& context);
void add_key_list(CLI::App& group, Context& context);

/// Words with blanks between them, as a shell splits what is not quoted.
[[nodiscard]] std::string joined(const std::vector<std::string>& words);

/// The comment behind the key in the line of a public key, "alice@lab"; empty: nothing.
[[nodiscard]] std::string comment_of(const std::string& public_line);
/// The text as a name of a grant, which a shell takes as it is: "Hans-Meier".
[[nodiscard]] std::string as_name(std::string text);

/// A grant, and its line in its file.
struct GrantLine {
  std::size_t number = 0;
  access::Grant grant{};
};
/// The grants that are understood, with their lines.
[[nodiscard]] std::vector<GrantLine> grant_lines_of(const std::string& text);

/// The command with which a server lets this key in: `rtpm key authorize '…' …`.
[[nodiscard]] std::string authorize_command(const std::string& public_line);

}  // namespace rtpm::tool
