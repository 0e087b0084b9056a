#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/access/object_pattern.hpp"
#include "rtpm/access/role.hpp"
#include "rtpm/access/subject.hpp"
#include "rtpm/base/priority.hpp"

namespace rtpm::access {

/// The permissions of one line of `authorized`.
struct Grant {
  Subject subject{};
  std::string name{};  ///< The name in logs and errors; may be empty.
  Role role = Role::kNone;
  std::vector<ObjectPattern> objects{};
  Priority ceiling = Priority::kHighest;
  std::vector<AddressRange> from{};  ///< Empty for any address, including this host.
  friend bool operator==(const Grant&, const Grant&) = default;
};

/// A line that could not be parsed and so allows nothing.
struct LineFault {
  std::size_t line = 0;    ///< Counts from 1.
  std::size_t column = 0;  ///< Counts from 1, in bytes.
  std::string why{};       ///< Names the correct form; foreign text in it is escaped.
  friend bool operator==(const LineFault&, const LineFault&) = default;
};
/// "authorized:3:14: unknown role 'comand'; did you mean 'command'?"
[[nodiscard]] std::string to_text(const LineFault& fault, std::string_view file);

/// The bounds of a file of grants. Anything beyond them is a fault and allows nothing.
inline constexpr std::size_t kGrantCountMax = 4096;
inline constexpr std::size_t kGrantLineSizeMax = 4096;
inline constexpr std::size_t kGrantItemCountMax = 32;  ///< Patterns, or ranges, per line.
inline constexpr std::size_t kFaultCountMax = 32;      ///< The most faults that are reported.

/// The contents of a file of grants.
struct Authorized {
  std::vector<Grant> grants{};
  std::vector<LineFault> faults{};
  std::size_t fault_count = 0;  ///< Includes faults beyond kFaultCountMax.
};

/// Parses grants, one per line; a line that begins with `#` is a comment:
///
///     rtpm25519 BASE64 name=alice role=command on=lab/arm0,lab/cam/** max-priority=24000
///     uid:1001 name=logger role=observe on=**
///     anonymous role=observe on=public/** from=192.168.7.0/24
///
/// `role` and `on` are required. A faulty line is ignored as a whole; all others stay in force.
/// @realtime set-up only
/// @source   spec/security.md
[[nodiscard]] Authorized parse_authorized(std::string_view text);

/// The line that parse_authorized() reads as `grant`.
[[nodiscard]] std::string to_line(const Grant& grant);

}  // namespace rtpm::access
