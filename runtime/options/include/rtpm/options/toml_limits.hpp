#pragma once

#include <algorithm>
#include <cstddef>
#include <string_view>

namespace rtpm::options {

/// Larger files are refused: a wrong path must not exhaust the memory.
inline constexpr std::size_t kTomlSizeMax = std::size_t{1024} * 1024;
/// Each dot may nest a table deeper, on any line, and toml++ recurses that deep.
inline constexpr std::ptrdiff_t kTomlDotCountMax = 4096;

/// Whether toml++ might need more stack for the text than a thread has.
/// @realtime set-up only
[[nodiscard]] inline bool may_nest_too_deeply(std::string_view toml) {
  return std::ranges::count(toml, '.') > kTomlDotCountMax;
}

}  // namespace rtpm::options
