#pragma once

#include <optional>
#include <string>
#include <vector>

#include "rtpm/schema/source.hpp"

namespace rtpm::schema {

/// Another place that an error refers to, such as the first method with the same number.
struct Note {
  Location location{};
  std::string text{};
};

/// Why a schema is refused.
struct Diagnostic {
  Location location{};
  std::string message{};  ///< One sentence without a full stop: "method `a` has no rtpm_id".
  std::string hint{};     ///< The remedy; may be empty.
  std::optional<Note> note{};
};

using Diagnostics = std::vector<Diagnostic>;

/// The diagnostic as text, ending with a newline:
///
///     arm.fbs:12:3: error: method `stop` of service `lab.Arm` has no rtpm_id
///        12 |   stop(rtpm.Empty):rtpm.Empty;
///           |   ^~~~
///     hint: give it a number …
[[nodiscard]] std::string render(const Diagnostic& diagnostic);

/// At most 20 diagnostics, ordered by position, and the number of further ones.
[[nodiscard]] std::string render(Diagnostics diagnostics);

}  // namespace rtpm::schema
