#include "rtpm/predicate/number.hpp"

#include <charconv>
#include <cmath>
#include <limits>

namespace rtpm::predicate {
namespace {

/// The number, if it spans all of `text`.
template <class T, class... Base>
std::optional<T> parse_whole(std::string_view text, Base... base) noexcept {
  T value{};
  const char* const end = text.data() + text.size();
  const auto read = std::from_chars(text.data(), end, value, base...);
  const bool is_whole = read.ec == std::errc{} && read.ptr == end;
  return is_whole ? std::optional(value) : std::nullopt;
}

}  // namespace

std::optional<std::uint64_t> parse_natural(std::string_view text) noexcept {
  const bool is_hex = text.starts_with("0x") || text.starts_with("0X");
  if (is_hex) text.remove_prefix(2);
  return parse_whole<std::uint64_t>(text, is_hex ? 16 : 10);
}

std::optional<Number> parse_number(std::string_view text) noexcept {
  if (const auto natural = parse_natural(text)) {
    if (*natural > static_cast<std::uint64_t>(std::numeric_limits<std::int64_t>::max())) {
      return Number(*natural);
    }
    return Number(static_cast<std::int64_t>(*natural));
  }
  if (const auto integer = parse_whole<std::int64_t>(text, 10)) return Number(*integer);
  const auto real = parse_whole<double>(text);
  if (!real || !std::isfinite(*real)) return std::nullopt;
  return Number(*real);
}

}  // namespace rtpm::predicate
