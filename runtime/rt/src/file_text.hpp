#pragma once

#include <span>
#include <string_view>

namespace rtpm::rt {

/// What the file at `path` holds, as far as `buffer` has room, without the line's end; empty if it
/// can't be read.
/// @realtime alloc-free, three syscalls
[[nodiscard]] std::string_view read_file(const char* path, std::span<char> buffer) noexcept;

}  // namespace rtpm::rt
