#include <algorithm>
#include <functional>
#include <sstream>
#include <string_view>

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

std::string comment_of(const std::string& public_line) {
  const std::size_t key = public_line.find(' ');
  const std::size_t comment = key == std::string::npos ? key : public_line.find(' ', key + 1);
  return comment == std::string::npos ? std::string() : public_line.substr(comment + 1);
}

std::string as_name(std::string text) {
  const auto is_plain = [](char c) {
    return (c >= '0' && c <= '9') || (c >= 'A' && c <= 'Z') || (c >= 'a' && c <= 'z') ||
           std::string_view("@._-").find(c) != std::string_view::npos;
  };
  std::ranges::replace_if(text, std::not_fn(is_plain), '-');
  return text;
}

std::string authorize_command(const std::string& public_line) {
  const std::string comment = comment_of(public_line);
  const std::string key = public_line.substr(0, public_line.size() - comment.size());
  return "rtpm key authorize '" + key + as_name(comment) + "' --role command --on '**'";
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
