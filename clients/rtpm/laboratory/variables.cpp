#include "laboratory/variables.hpp"

#include <algorithm>
#include <cstdlib>

#include "rtpm/options/suggestion.hpp"

namespace rtpm::laboratory {
namespace {

constexpr std::string_view kEnvironment = "environment.";
constexpr std::string_view kUrl = ".url";

std::string unknown(const std::string& name, const Scope& scope) {
  std::vector<std::string> names;
  for (const auto& [variable, value] : scope.variables)
    names.push_back(variable);
  for (const std::string& program : scope.programs)
    names.push_back(program + std::string(kUrl));
  return "nothing is called ${" + name + "}" + options::suggestion(name, names) +
         "; there are variables, ${PROGRAM.url} and ${environment.NAME}";
}

/// Appends the value of `name`. @return the mistake; empty if there is none
std::string append_named(Text& text, const std::string& name, const Scope& scope) {
  if (const auto found = scope.variables.find(name); found != scope.variables.end()) {
    text.append(found->second);
    return {};
  }
  if (name.starts_with(kEnvironment)) {
    const char* const value = std::getenv(name.substr(kEnvironment.size()).c_str());
    if (value == nullptr) return "${" + name + "} is not set in the environment";
    text.append(value);
    return {};
  }
  if (name.ends_with(kUrl)) {
    const auto program =
        std::ranges::find(scope.programs, name.substr(0, name.size() - kUrl.size()));
    if (program != scope.programs.end()) {
      text.append_url_of(static_cast<std::size_t>(program - scope.programs.begin()));
      return {};
    }
  }
  return unknown(name, scope);
}

}  // namespace

expected<Text, std::string> expand(std::string_view text, const Scope& scope) {
  Text expanded;
  std::string literal;
  while (!text.empty()) {
    const std::size_t dollar = std::min(text.find('$'), text.size());
    literal += text.substr(0, dollar);
    text.remove_prefix(dollar);
    if (text.starts_with("$$")) {
      literal += '$';
      text.remove_prefix(2);
    } else if (text.starts_with("${")) {
      const std::size_t end = text.find('}');
      if (end == std::string_view::npos) return unexpected{std::string("'${' has no '}'")};
      expanded.append(std::exchange(literal, {}));
      std::string wrong = append_named(expanded, std::string(text.substr(2, end - 2)), scope);
      if (!wrong.empty()) return unexpected{std::move(wrong)};
      text.remove_prefix(end + 1);
    } else if (!text.empty()) {
      literal += '$';
      text.remove_prefix(1);
    }
  }
  expanded.append(std::move(literal));
  return expanded;
}

}  // namespace rtpm::laboratory
