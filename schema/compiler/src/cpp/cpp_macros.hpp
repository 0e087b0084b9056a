#pragma once

#include <string_view>

namespace rtpm::schema::cpp {

/// Whether `name` may be a macro of a compiler or of the headers that generated code includes: EOF,
/// NULL, errno, assert, and with GNU extensions linux and unix.
[[nodiscard]] bool is_macro(std::string_view name) noexcept;

}  // namespace rtpm::schema::cpp
