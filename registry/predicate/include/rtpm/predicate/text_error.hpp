#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace rtpm::predicate {

/// The position and cause of an error in the text of a predicate or filter.
struct TextError {
  std::size_t offset = 0;  ///< In bytes, from 0; the text's size if the error is at its end.
  std::string what{};      ///< A clause: "no type is named 'lab.Tuched' (did you mean …?)".

  /// Two lines: the text, and a caret below the offset. Escapes unsafe characters.
  [[nodiscard]] std::string picture(std::string_view text) const;
};

}  // namespace rtpm::predicate
