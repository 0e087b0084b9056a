#include "cli/pattern.hpp"

#include <cstddef>

namespace rtpm::tool {
namespace {

/// Whether the set at the front of `pattern` has `c`; takes it off the pattern.
bool takes_of_set(std::string_view& pattern, char c) {
  const bool is_other = pattern.substr(1).starts_with('!');
  const std::size_t begin = is_other ? 2 : 1;
  // A bracket that is the first in its set does not close it.
  const std::size_t end = pattern.find(']', begin + 1);
  if (end == std::string_view::npos) {
    pattern.remove_prefix(1);
    return c == '[';
  }
  const std::string_view set = pattern.substr(begin, end - begin);
  pattern.remove_prefix(end + 1);
  bool is_in = false;
  for (std::size_t i = 0; i < set.size(); ++i) {
    const bool is_range = i + 2 < set.size() && set[i + 1] == '-';
    is_in = is_in || (is_range ? set[i] <= c && c <= set[i + 2] : set[i] == c);
    if (is_range) i += 2;
  }
  return is_in != is_other;
}

/// Whether the front of `pattern`, which is no *, is for `c`; takes it off the pattern.
bool takes(std::string_view& pattern, char c) {
  if (pattern.empty()) return false;
  if (pattern.front() == '[') return takes_of_set(pattern, c);
  const bool is_any = pattern.front() == '?';
  if (pattern.front() == '\\' && pattern.size() > 1) pattern.remove_prefix(1);
  const bool is_same = is_any || pattern.front() == c;
  pattern.remove_prefix(1);
  return is_same;
}

}  // namespace

bool matches(std::string_view pattern, std::string_view text) {
  // Behind the newest *: the pattern, and the text that it was tried on.
  std::string_view star_pattern;
  std::string_view star_text;
  bool has_star = false;
  while (!text.empty() || !pattern.empty()) {
    if (pattern.starts_with('*')) {
      pattern.remove_prefix(1);
      has_star = true;
      star_pattern = pattern;
      star_text = text;
    } else if (!text.empty() && takes(pattern, text.front())) {
      text.remove_prefix(1);
    } else {
      if (!has_star || star_text.empty()) return false;
      star_text.remove_prefix(1);
      pattern = star_pattern;
      text = star_text;
    }
  }
  return true;
}

}  // namespace rtpm::tool
