#include "rtpm/predicate/text_error.hpp"

#include <algorithm>

#include "rtpm/base/printable.hpp"

namespace rtpm::predicate {

std::string TextError::picture(std::string_view text) const {
  const std::size_t at = std::min(offset, text.size());
  const std::string before = printable(text.substr(0, at), kShownWhole);
  const std::string after = printable(text.substr(at), kShownWhole);
  const auto width = std::ranges::count_if(before, [](char b) { return (b & 0xc0) != 0x80; });
  return before + after + "\n" + std::string(static_cast<std::size_t>(width), ' ') + "^";
}

}  // namespace rtpm::predicate
