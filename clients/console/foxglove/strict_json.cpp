#include "foxglove/strict_json.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <string_view>

namespace rtpm::console::foxglove {

std::string strict_json(const std::string& text) {
  constexpr std::array<std::string_view, 6> kNoNumbers{"inf",  "-inf",     "nan",
                                                       "-nan", "infinity", "-infinity"};
  std::string strict;
  strict.reserve(text.size());
  bool is_in_string = false;
  for (std::size_t i = 0; i < text.size();) {
    const char c = text[i];
    const bool is_word = std::isalpha(static_cast<unsigned char>(c)) != 0 || c == '-';
    if (is_in_string || !is_word) {
      if (is_in_string && c == '\\' && i + 1 < text.size()) strict += text[i++];
      if (c == '"') is_in_string = !is_in_string;
      strict += text[i++];
      continue;
    }
    std::size_t end = i + 1;
    while (end < text.size() && std::isalpha(static_cast<unsigned char>(text[end])) != 0)
      ++end;
    const std::string_view word = std::string_view(text).substr(i, end - i);
    strict += std::ranges::count(kNoNumbers, word) > 0 ? std::string_view("null") : word;
    i = end;
  }
  return strict;
}

}  // namespace rtpm::console::foxglove
