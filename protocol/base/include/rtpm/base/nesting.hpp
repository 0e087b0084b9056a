#pragma once

#include <cstddef>
#include <string_view>

namespace rtpm::inline base {

/// How deep another program's text may nest. Parsing, copying, printing and destroying its tree
/// recurse, and threads have small stacks.
inline constexpr std::size_t kNestingMax = 64;

/// Whether the arrays and objects of a JSON text nest at most `nesting_max` deep. Needs no memory
/// and does not recurse; the result is unspecified if the text is not JSON.
/// @realtime alloc-free
[[nodiscard]] constexpr bool is_json_nested_within(std::string_view text,
                                                   std::size_t nesting_max) noexcept {
  std::size_t depth = 0;
  bool is_in_string = false;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (c == '"') is_in_string = !is_in_string;
    if (is_in_string) {
      if (c == '\\') ++i;
    } else if (c == '{' || c == '[') {
      if (++depth > nesting_max) return false;
    } else if ((c == '}' || c == ']') && depth > 0) {
      --depth;
    }
  }
  return true;
}

/// Parses JSON nested at most kNestingMax deep: the only allowed way to parse another program's
/// JSON.
/// @tparam Json  nlohmann's, ordered or not; the caller includes its headers
/// @return discarded if not JSON, or nested deeper
/// @realtime set-up only
template <class Json>
[[nodiscard]] Json parse_bounded_json(std::string_view text) {
  if (!is_json_nested_within(text, kNestingMax)) return Json(Json::value_t::discarded);
  return Json::parse(text.begin(), text.end(), nullptr, /*allow_exceptions=*/false);
}

}  // namespace rtpm::inline base
