#pragma once

#include <chrono>
#include <cstdint>
#include <ctime>

namespace rtpm::inline base {

/// The date and the time of day of `utc_ns` nanoseconds since 1970, for std::strftime; without the days
/// of the week and of the year.
[[nodiscard]] inline std::tm civil_utc(std::uint64_t utc_ns) noexcept {
  const std::chrono::sys_seconds time{
      std::chrono::seconds{static_cast<std::int64_t>(utc_ns / 1'000'000'000)}};
  const auto day = std::chrono::floor<std::chrono::days>(time);
  const std::chrono::year_month_day date{day};
  const std::chrono::hh_mm_ss clock{time - day};
  std::tm parts{};
  parts.tm_year = static_cast<int>(date.year()) - 1900;
  parts.tm_mon = static_cast<int>(static_cast<unsigned>(date.month())) - 1;
  parts.tm_mday = static_cast<int>(static_cast<unsigned>(date.day()));
  parts.tm_hour = static_cast<int>(clock.hours().count());
  parts.tm_min = static_cast<int>(clock.minutes().count());
  parts.tm_sec = static_cast<int>(clock.seconds().count());
  return parts;
}

}  // namespace rtpm::inline base
