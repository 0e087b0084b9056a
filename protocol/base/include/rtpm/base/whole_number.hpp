#pragma once

#include <charconv>
#include <concepts>
#include <optional>
#include <string_view>
#include <system_error>

namespace rtpm::inline base {

/// Parses all of `text` as a decimal number; nullopt if it is not one, or `Number` can't hold it.
/// @realtime alloc-free
template <std::integral Number>
[[nodiscard]] std::optional<Number> whole_number_of(std::string_view text) noexcept {
  Number number{};
  const char* const end = text.data() + text.size();
  const auto read = std::from_chars(text.data(), end, number);
  if (read.ec != std::errc{} || read.ptr != end) return std::nullopt;
  return number;
}

}  // namespace rtpm::inline base
