#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace rtpm::program {

/// Text as std::printf() would print it, for a program's output.
/// @realtime set-up only
[[nodiscard]] [[gnu::format(printf, 1, 2)]] std::string formatted(const char* format, ...);

/// The texts with a separator between them: "a, b".
/// @realtime set-up only
[[nodiscard]] std::string joined(const std::vector<std::string>& texts,
                                 std::string_view separator = ", ");

/// " (did you mean 'port'?)", or nothing if no candidate resembles `word`.
/// @realtime set-up only
[[nodiscard]] std::string suggestion(std::string_view word,
                                     const std::vector<std::string>& candidates);

}  // namespace rtpm::program
