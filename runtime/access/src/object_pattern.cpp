#include "rtpm/access/object_pattern.hpp"

#include <algorithm>
#include <utility>

#include "rtpm/wire/url.hpp"

namespace rtpm::access {
namespace {

/// The first component, and the rest after it.
std::pair<std::string_view, std::string_view> split(std::string_view path) noexcept {
  const std::size_t slash = path.find('/');
  if (slash == std::string_view::npos) return {path, {}};
  return {path.substr(0, slash), path.substr(slash + 1)};
}

/// Remembers one `**` at a time: the latest can match everything that an earlier one could.
bool covers(std::string_view pattern, std::string_view path) noexcept {
  bool has_star = false;
  std::string_view after_star;
  std::string_view path_at_star;
  while (!path.empty()) {
    const auto [wanted, next_pattern] = split(pattern);
    const auto [component, next_path] = split(path);
    if (wanted == "**") {
      if (next_pattern.empty()) return true;
      has_star = true;
      after_star = pattern = next_pattern;
      path_at_star = path;
    } else if (!pattern.empty() && (wanted == "*" || wanted == component)) {
      pattern = next_pattern;
      path = next_path;
    } else if (has_star) {
      pattern = after_star;
      path = path_at_star = split(path_at_star).second;
    } else {
      return false;
    }
  }
  return pattern.empty() || pattern == "**";
}

}  // namespace

std::optional<ObjectPattern> ObjectPattern::parse(std::string_view text) {
  std::string path;
  std::string_view rest = text;
  while (!rest.empty()) {
    const auto [component, next] = split(rest);
    if (!path.empty()) path += '/';
    path += component == "*" || component == "**" ? std::string_view("star") : component;
    const bool is_last = component.size() == rest.size();
    if (component.empty() || (next.empty() && !is_last)) return std::nullopt;
    rest = next;
  }
  if (!wire::is_valid_path(path)) return std::nullopt;
  return ObjectPattern(text);
}

bool ObjectPattern::covers(std::string_view path) const noexcept {
  return access::covers(text_, path);
}

}  // namespace rtpm::access
