#pragma once

#include <atomic>
#include <cstdint>

#include "rtpm/base/time.hpp"

/// Sleeping on a word of memory that processes share, which std::atomic::wait does not do.
/// Source: futex(2).
namespace rtpm::transport {

/// Sleeps while the word is `value`, until it is woken, or until `until`; wakes for nothing at
/// times.   RT: alloc-free, one syscall.
void sleep_on_word(std::atomic<std::uint32_t>& word, std::uint32_t value,
                   MonotonicTime until) noexcept;

/// Wakes who sleeps on the word.   RT: alloc-free, one syscall, never blocks.
void wake_on_word(std::atomic<std::uint32_t>& word) noexcept;

}  // namespace rtpm::transport
