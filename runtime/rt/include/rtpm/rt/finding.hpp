#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace rtpm::rt {

/// How bad a finding is, the worst last.
enum class Severity : std::uint8_t {
  kGood,     ///< Nothing to do.
  kNote,     ///< Costs nothing by itself, or could not be determined.
  kWarning,  ///< Costs latency, data or comfort.
  kProblem,  ///< Nothing bounds the latency, or something does not work at all.
};

/// "good", "note", "warning" or "problem".
[[nodiscard]] std::string_view to_string(Severity severity) noexcept;

/// A file of the system, and the text that it should hold.
struct Setting {
  std::string path;
  std::string value;
  friend bool operator==(const Setting&, const Setting&) = default;
};

/// One thing that was judged. Texts are clauses; foreign parts are not escaped.
struct Finding {
  std::string id{};  ///< "socket-buffers": stays the same over releases.
  Severity severity = Severity::kGood;
  std::string text{};    ///< The fact.
  std::string cost{};    ///< Its cost, with a magnitude; may be empty.
  std::string remedy{};  ///< Lines for a shell, or a clause; empty if none is needed.
  /// Settings that are safe to apply and to revert; they last until a reboot. May be empty.
  std::vector<Setting> fixes{};
  std::string lasting{};  ///< A line for a shell that makes `fixes` survive a reboot.

  [[nodiscard]] bool is_fixable() const noexcept { return !fixes.empty(); }
};

}  // namespace rtpm::rt
