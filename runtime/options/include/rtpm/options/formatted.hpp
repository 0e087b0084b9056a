#pragma once

#include <string>

namespace rtpm::options {

/// Text as std::printf() would print it, for what a program shows.
/// @realtime set-up only
[[nodiscard]] [[gnu::format(printf, 1, 2)]] std::string formatted(const char* format, ...);

}  // namespace rtpm::options
