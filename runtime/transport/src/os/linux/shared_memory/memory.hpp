#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>

#include "rtpm/base/time.hpp"
#include "rtpm/transport/socket.hpp"

// Memory shared between processes: files without names, passed by descriptor, and sleeping on a
// word in them, which std::atomic::wait does not support. Source: memfd_create(2), futex(2).
namespace rtpm::transport {

/// Creates a file of `size` zeros; not open if the system refuses, with the reason in errno.
[[nodiscard]] Descriptor make_memory(const char* name, std::size_t size) noexcept;

/// Fixes the size permanently, so that no access to a mapping can fail (hp-16.1-5).
/// @param more_seals  see F_ADD_SEALS in fcntl(2)
[[nodiscard]] bool seal_memory(int memory, int more_seals = 0) noexcept;

/// The size of a file that cannot shrink; 0 if it can shrink or is not such a file.
[[nodiscard]] std::size_t sealed_size(int memory) noexcept;

inline constexpr std::uint32_t kAnyBit = 0xffff'ffff;

/// Sleeps while the word is `value`, until a wake-up for any of `bits`, or until `until`. May wake
/// spuriously.
/// @realtime alloc-free, one system call
void sleep_on_word(std::atomic<std::uint32_t>& word, std::uint32_t value, MonotonicTime until,
                   std::uint32_t bits = kAnyBit) noexcept;

/// Wakes at most `count_max` sleepers for any of `bits`, the most urgent first.
/// @realtime alloc-free, one system call, never blocks
void wake_on_word(std::atomic<std::uint32_t>& word, int count_max = 1,
                  std::uint32_t bits = kAnyBit) noexcept;

}  // namespace rtpm::transport
