#pragma once

#include <string>
#include <string_view>

namespace rtpm::names {

/// `text` in quotes, fit for a terminal whatever it holds.
[[nodiscard]] std::string quoted(std::string_view text);

}  // namespace rtpm::names
