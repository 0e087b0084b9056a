#pragma once

#include <string>

namespace rtpm::options {

/// Text as std::printf() would print it, for a program's output.
/// @realtime set-up only
[[nodiscard]] [[gnu::format(printf, 1, 2)]] std::string formatted(const char* format, ...);

}  // namespace rtpm::options
