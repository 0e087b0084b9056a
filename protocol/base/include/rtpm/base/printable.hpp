#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace rtpm::inline base {

/// The bytes of another program's name or sentence that are shown at most.
inline constexpr std::size_t kShownSizeMax = 256;
/// No limit.
inline constexpr std::size_t kShownWhole = static_cast<std::size_t>(-1);

/// Another program's `text`, safe for a terminal or a log: one line that cannot change the text
/// around it. Control characters, bytes that are not UTF-8, and characters that are invisible or
/// reverse the direction of writing become \n, \t, \r, \x1b or \u{202e}. Everything else stays, a
/// backslash too, so that the result of a second call is the same.
/// @param size_max  the bytes of `text` that are shown at most; "…" replaces the rest
/// @realtime set-up only
[[nodiscard]] std::string printable(std::string_view text, std::size_t size_max = kShownSizeMax);

/// Like printable(), for a text of several lines: its line feeds and tabs stay.
[[nodiscard]] std::string printable_lines(std::string_view text,
                                          std::size_t size_max = kShownWhole);

}  // namespace rtpm::inline base
