#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace rtpm::predicate {

/// Where and why a text is no predicate or filter.
struct TextError {
  std::size_t offset = 0;  ///< In bytes, from 0; the text's size: at its end.
  std::string what{};      ///< A clause: "no type is named 'lab.Tuched' (did you mean …?)".

  /// The text, and below it a caret at the offset: two lines. Foreign characters are escaped.
  [[nodiscard]] std::string picture(std::string_view text) const;
};

}  // namespace rtpm::predicate
