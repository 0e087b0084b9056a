#pragma once

#include <optional>
#include <string>
#include <vector>

#include "rtpm/schema/source.hpp"

namespace rtpm::schema {

/// A second place that an error is about, such as the method that has the number already.
struct Note {
  Location location{};
  std::string text{};
};

/// One cause why a schema is refused: where, what, and what to do about it.
struct Diagnostic {
  Location location{};
  std::string message{};  ///< One sentence without its end: "method `a` has no rtpm_id".
  std::string hint{};     ///< The remedy; may be empty.
  std::optional<Note> note{};
};

using Diagnostics = std::vector<Diagnostic>;

/// The text that a person reads, ending with a new line:
///
///     arm.fbs:12:3: error: method `stop` of service `lab.Arm` has no rtpm_id
///        12 |   stop(rtpm.Empty):rtpm.Empty;
///           |   ^~~~
///     hint: give it a number …
[[nodiscard]] std::string render(const Diagnostic& diagnostic);

/// All of them in the order of their places, at most 20, and how many were left out.
[[nodiscard]] std::string render(Diagnostics diagnostics);

}  // namespace rtpm::schema
