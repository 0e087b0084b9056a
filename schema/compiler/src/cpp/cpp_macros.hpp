#pragma once

#include <string_view>

namespace rtpm::schema::cpp {

/// Whether compilers or the headers that generated code includes may take `name` as a macro: EOF,
/// NULL, errno, assert, and with GNU extensions linux and unix.
[[nodiscard]] bool is_macro(std::string_view name) noexcept;

}  // namespace rtpm::schema::cpp
