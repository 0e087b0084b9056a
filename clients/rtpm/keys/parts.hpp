#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

#include "cli/context.hpp"
#include "rtpm/access/authorized.hpp"

// The commands of `rtpm key`, and their common parts.
namespace rtpm::tool {

void add_key_new(CLI::App& group, Context& context);
void add_key_show(CLI::App& group, Context& context);
void add_key_learn(CLI::App& group, Context& context);
void add_key_forget(CLI::App& group, Context& context);
void add_key_authorize(CLI::App& group, Context& context);
void add_key_revoke(CLI::App& group, Context& context);
void add_key_list(CLI::App& group, Context& context);

/// Joins the words into which a shell splits an unquoted text.
[[nodiscard]] std::string joined(const std::vector<std::string>& words);

/// The comment after the key in a public-key line, "alice@lab"; empty if there is none.
[[nodiscard]] std::string comment_of(const std::string& public_line);
/// Turns the text into a name for a grant, which needs no shell quotes: "Hans-Meier".
[[nodiscard]] std::string as_name(std::string text);

/// A grant and its line number in the file.
struct GrantLine {
  std::size_t number = 0;
  access::Grant grant{};
};
/// The valid grants, with their line numbers.
[[nodiscard]] std::vector<GrantLine> grant_lines_of(const std::string& text);

/// The command that makes a server accept this key: `rtpm key authorize '…' …`.
[[nodiscard]] std::string authorize_command(const std::string& public_line);

}  // namespace rtpm::tool
