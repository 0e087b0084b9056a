#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace rtpm::inline base {

/// How much of a foreign name or sentence is shown.
inline constexpr std::size_t kShownSizeMax = 256;
/// For text that is shown whole.
inline constexpr std::size_t kShownWhole = static_cast<std::size_t>(-1);

/// `text` of another program as a terminal or a log may show it: one line that can neither be taken
/// for several nor change what stands around it. Control characters, bytes that are no UTF-8, and
/// what is invisible or turns the direction of writing are written as \n, \t, \r, \x1b or \u{202e};
/// anything else stays, a backslash as well, so that what is made printable twice does not change.
/// At most `size_max` bytes of `text` are shown; "…" stands for the rest.   Set-up only.
[[nodiscard]] std::string printable(std::string_view text, std::size_t size_max = kShownSizeMax);

/// The same for a text of several lines: its line feeds and tabs stay.   Set-up only.
[[nodiscard]] std::string printable_lines(std::string_view text,
                                          std::size_t size_max = kShownWhole);

}  // namespace rtpm::inline base
