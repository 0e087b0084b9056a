#pragma once

#include <cstdint>
#include <cstdio>
#include <filesystem>

/// The operating system's side of the files that are read and written by <cstdio>. Where one fails,
/// errno says why.
namespace rtpm::exports::os {

[[nodiscard]] std::FILE* open(const std::filesystem::path& path);
/// Creates a file; an existing one is an error.
[[nodiscard]] std::FILE* create(const std::filesystem::path& path);
/// Opens a file, which is made if it is missing; -1 if the system refuses.
[[nodiscard]] int open_to_append(const std::filesystem::path& path) noexcept;
/// Goes to an offset, which may be beyond 2 GiB.
[[nodiscard]] bool seek(std::FILE* file, std::uint64_t offset) noexcept;
[[nodiscard]] bool seek_end(std::FILE* file) noexcept;

}  // namespace rtpm::exports::os
