#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "cli/output.hpp"
#include "laboratory/plan.hpp"
#include "laboratory/supervision.hpp"

namespace rtpm::tool {

/// A table of a laboratory's programs, a line each below a header: program, state, process, time in
/// the state, restarts, and its URL or the reason of its state.
/// @param width  the greatest width of a line; 0 for no limit
[[nodiscard]] std::vector<std::string> status_table(const laboratory::Plan& plan,
                                                    const laboratory::Supervision& supervision,
                                                    MonotonicTime now, std::size_t width);

/// The colour of a state.
[[nodiscard]] Colour colour_of(laboratory::State state);

/// "0.3 s", "12 s", "3 min 5 s", "2 h 10 min".
[[nodiscard]] std::string span_text(Duration span);

/// The first characters of UTF-8 text, at most `width`.
[[nodiscard]] std::string clipped(const std::string& text, std::size_t width);

}  // namespace rtpm::tool
