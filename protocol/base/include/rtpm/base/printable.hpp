#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace rtpm::inline base {

/// The most bytes of another program's name or sentence that are shown.
inline constexpr std::size_t kShownSizeMax = 256;
/// No limit.
inline constexpr std::size_t kShownWhole = static_cast<std::size_t>(-1);

/// Makes another program's `text` safe for a terminal or log: one line that can't affect the text
/// around it. Control characters, bytes that are not UTF-8, and characters that are invisible or
/// reverse the writing direction become \n, \t, \r, \x1b or \u{202e}. Everything else stays,
/// including backslashes, so a second call changes nothing.
/// @param size_max  the most bytes of `text` that are shown; "…" replaces the rest
/// @realtime set-up only
[[nodiscard]] std::string printable(std::string_view text, std::size_t size_max = kShownSizeMax);

/// Like printable(), for a text with several lines: keeps line feeds and tabs.
[[nodiscard]] std::string printable_lines(std::string_view text,
                                          std::size_t size_max = kShownWhole);

}  // namespace rtpm::inline base
