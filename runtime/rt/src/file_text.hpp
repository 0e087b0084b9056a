#pragma once

#include <span>
#include <string_view>

namespace rtpm::rt {

/// The contents of the file at `path`, up to the size of `buffer`, without the final newline; empty
/// if it can't be read.
/// @realtime alloc-free, three syscalls
[[nodiscard]] std::string_view read_file(const char* path, std::span<char> buffer) noexcept;

}  // namespace rtpm::rt
