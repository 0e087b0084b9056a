#pragma once

#include <string_view>

namespace rtpm::tool {

/// Whether a pattern of a shell is for the whole of `text`. In it, * stands for any text, ? for any
/// character, [a-z] for one of a set, [!a-z] for one of no such set, and \ takes its meaning from
/// the next. A set that is not closed is a plain bracket.
[[nodiscard]] bool matches(std::string_view pattern, std::string_view text);

}  // namespace rtpm::tool
