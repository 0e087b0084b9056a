#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace rtpm::rt {

/// How serious a finding is, the most serious last.
enum class Severity : std::uint8_t {
  kGood,     ///< Nothing to do.
  kNote,     ///< Costs nothing by itself, or is unknown.
  kWarning,  ///< Costs latency, data or comfort.
  kProblem,  ///< Latency is unbounded, or something does not work at all.
};

/// "good", "note", "warning" or "problem".
[[nodiscard]] std::string_view to_string(Severity severity) noexcept;

/// A system file, and the text that it should contain.
struct Setting {
  std::string path;
  std::string value;
  friend bool operator==(const Setting&, const Setting&) = default;
};

/// One judged aspect of the host. Texts are clauses; foreign parts are not escaped.
struct Finding {
  std::string id{};  ///< Such as "socket-buffers"; stable across releases.
  Severity severity = Severity::kGood;
  std::string text{};    ///< The fact.
  std::string cost{};    ///< Its cost, with an order of magnitude; may be empty.
  std::string remedy{};  ///< Shell lines, or a clause; empty if none is needed.
  /// Settings that can safely be applied and reverted; they last until a reboot. May be empty.
  std::vector<Setting> fixes{};
  std::string lasting{};  ///< A shell line that makes `fixes` survive a reboot.

  [[nodiscard]] bool is_fixable() const noexcept { return !fixes.empty(); }
};

}  // namespace rtpm::rt
