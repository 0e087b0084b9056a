#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/schema/model.hpp"

/// Texts that several back ends write alike.
namespace rtpm::schema::emit {

/// Generated lines are no longer than this where they can be broken.
inline constexpr std::size_t kColumnMax = 100;

/// Adds `more` to `lines`, behind a blank line.
void add_paragraph(Documentation& lines, const Documentation& more);

/// A comment as one line, without blanks around: "the force along x".
[[nodiscard]] std::string one_line(const Documentation& documentation);

/// A member's comment and quantity in one line: "the force along x (newton, -20 to 20)"; empty if
/// there is nothing to say.
[[nodiscard]] std::string member_note(const Documentation& documentation,
                                      const std::string& quantity);

/// All that a caller should know of a method: its comment, quantities and facts.
[[nodiscard]] Documentation method_notes(const Model& model, const Method& method);

/// Breaks a line at blanks, where it is longer than `size_max`.
[[nodiscard]] Documentation wrapped(std::string line, std::size_t size_max);

/// `text` as UTF-8, which FlatBuffers does not require of comments. U+FFFD stands for other bytes.
[[nodiscard]] std::string utf_8(const std::string& text);

[[nodiscard]] std::string joined(const std::vector<std::string>& parts, std::string_view separator);

/// "    head(a, b)tail", with breaks where that is too long; no newline at the end.
[[nodiscard]] std::string call(const std::string& head, const std::vector<std::string>& arguments,
                               const std::string& tail, const std::string& deeper);

/// A comment `/** … */`, ending with a newline; empty if there are no lines. `escape` runs on each.
[[nodiscard]] std::string block_comment(const Documentation& lines, const std::string& indent,
                                        std::string (*escape)(std::string_view));

}  // namespace rtpm::schema::emit
