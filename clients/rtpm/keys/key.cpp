#include <algorithm>
#include <sstream>

#include "cli/command.hpp"
#include "keys/commands.hpp"
#include "keys/parts.hpp"

namespace rtpm::tool {

std::string joined(const std::vector<std::string>& words) {
  std::string text;
  for (const std::string& word : words)
    text += (text.empty() ? "" : " ") + word;
  return text;
}

std::vector<GrantLine> grant_lines_of(const std::string& text) {
  std::vector<GrantLine> lines;
  std::istringstream stream(text);
  std::size_t number = 0;
  for (std::string line; std::getline(stream, line);) {
    ++number;
    for (access::Grant& grant : access::parse_authorized(line).grants)
      lines.push_back({number, std::move(grant)});
  }
  return lines;
}

std::string authorize_command(const std::string& public_line) {
  return "rtpm key authorize '" + public_line + "' --role command --on '**'";
}

void add_key(CLI::App& program, Context& context) {
  CLI::App& group =
      add_command_group(program, "key", "Keys of programs and servers, and who may do what");
  add_key_new(group, context);
  add_key_show(group, context);
  add_key_learn(group, context);
  add_key_forget(group, context);
  add_key_authorize(group, context);
  add_key_revoke(group, context);
  add_key_list(group, context);
}

}  // namespace rtpm::tool
