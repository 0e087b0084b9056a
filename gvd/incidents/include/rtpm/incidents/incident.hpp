#pragma once

#include <cstdint>
#include <string>
#include <string_view>

/// Incidents of a laboratory: what went wrong, where, when, for how long, and who has seen it.
namespace rtpm::incidents {

enum class Severity : std::uint8_t {
  kInfo,     ///< For the record; asks for nothing.
  kWarning,  ///< Data or comfort suffer.
  kAlarm,    ///< A device is gone, stopped or at fault: a person has to look.
};
inline constexpr std::uint8_t kSeverityCount = 3;
/// "info", "warning", "alarm".
[[nodiscard]] std::string_view to_string(Severity severity) noexcept;

/// The most bytes of each text of an incident; longer ones are cut.
inline constexpr std::size_t kTextSizeMax = 240;
/// The most bytes of a person's name.
inline constexpr std::size_t kPersonSizeMax = 60;

/// A cause that lasts, or an event.
struct Cause {
  std::string who{};   ///< The device, server or service: "lab/arm0".
  std::string what{};  ///< A word from a fixed set: "lost".
  std::string why{};   ///< Details for people.
  Severity severity = Severity::kWarning;
  std::uint64_t since_ns = 0;  ///< When it began; 0: just now.
  /// For an event: `why` states a sum, so the newest one stands for those of the same second.
  bool is_sum = false;
};

/// Times are nanoseconds since 1970 in UTC.
struct Incident {
  std::uint64_t id = 0;
  std::string who{};
  std::string what{};
  std::string why{};
  Severity severity = Severity::kWarning;
  std::uint64_t since_ns = 0;
  std::uint64_t until_ns = 0;  ///< 0: it lasts.
  std::uint64_t count = 1;     ///< How often the cause began within this incident.
  std::string recording{};     ///< The recording that ran when it began; empty: none.
  std::string acknowledged_by{};
  std::uint64_t acknowledged_ns = 0;  ///< 0: nobody has acknowledged it.

  [[nodiscard]] bool is_open() const noexcept { return until_ns == 0; }
  [[nodiscard]] bool is_acknowledged() const noexcept { return acknowledged_ns != 0; }
  friend bool operator==(const Incident&, const Incident&) = default;
};

}  // namespace rtpm::incidents
