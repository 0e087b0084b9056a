#include "rtpm/program/duration.hpp"

#include <array>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <limits>
#include <system_error>

#include "rtpm/base/assert.hpp"

namespace rtpm::program {
namespace {

struct Unit {
  std::string_view name;
  std::int64_t ns;
};
// The largest first, as duration_text() tries them.
constexpr std::array kUnits{
    Unit{"h", 3'600'000'000'000}, Unit{"min", 60'000'000'000}, Unit{"s", 1'000'000'000},
    Unit{"ms", 1'000'000},        Unit{"us", 1'000},           Unit{"ns", 1},
};

std::optional<std::int64_t> unit_ns(std::string_view name) {
  for (const Unit& unit : kUnits) {
    if (unit.name == name) return unit.ns;
  }
  return std::nullopt;
}

/// `number` × `ns`, exactly where the number is whole; a floating product would lose the last
/// digits of times beyond 104 days.
std::optional<Duration> scaled(std::string_view number, std::int64_t ns) {
  const char* const end = number.data() + number.size();
  std::int64_t whole = 0;
  if (const auto read = std::from_chars(number.data(), end, whole);
      read.ec == std::errc{} && read.ptr == end) {
    if (whole > std::numeric_limits<std::int64_t>::max() / ns) return std::nullopt;
    return Duration{whole * ns};
  }
  double fraction = 0;
  const auto read = std::from_chars(number.data(), end, fraction, std::chars_format::fixed);
  if (read.ec != std::errc{} || read.ptr != end) return std::nullopt;
  const double product = fraction * static_cast<double>(ns);
  if (!(product < 9.2e18)) return std::nullopt;
  return Duration{std::llround(product)};
}

}  // namespace

std::optional<Duration> parse_duration(std::string_view text) {
  // Only digits and one point: from_chars alone would also take a sign, "inf" and "nan".
  const std::size_t digits = std::min(text.find_first_not_of("0123456789."), text.size());
  const std::string_view number = text.substr(0, digits);
  std::string_view unit = text.substr(digits);
  while (unit.starts_with(' '))
    unit.remove_prefix(1);
  if (number.empty()) return std::nullopt;
  if (unit.empty()) return number == "0" ? std::optional{Duration{0}} : std::nullopt;
  const std::optional<std::int64_t> ns = unit_ns(unit);
  return ns ? scaled(number, *ns) : std::nullopt;
}

std::string duration_text(Duration duration) {
  RTPM_ASSERT(duration.count() >= 0, "a time in an option is at least 0");
  if (duration.count() == 0) return "0s";
  for (const Unit& unit : kUnits) {
    if (duration.count() % unit.ns == 0) {
      return std::to_string(duration.count() / unit.ns) + std::string(unit.name);
    }
  }
  return {};  // Not reached: every time is a whole number of nanoseconds.
}

}  // namespace rtpm::program
