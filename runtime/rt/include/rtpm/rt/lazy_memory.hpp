#pragma once

#include <cstddef>

#include "rtpm/base/bytes.hpp"

namespace rtpm::rt {

/// Memory that costs nothing until it is used: pages are allocated at their first touch, and kept.
/// Holds large messages, to which a lane's real-time guarantees do not apply.
/// @ownership unmaps on destruction
/// @threads  like any memory. Set-up only; the first touch of a page faults
/// @errors   on Windows a system call that writes (a receive, a read) fails behind the first
///           kFirstSize bytes, unless the program has touched each page there before: prefault()
class LazyMemory {
 public:
  /// The size of the part that is allocated at once, and that a system call may fill untouched.
  static constexpr std::size_t kFirstSize = std::size_t{64} * 1024;

  LazyMemory() noexcept = default;
  /// Allocates zeros, aligned to a page. Empty if the system has no address space left.
  explicit LazyMemory(std::size_t size) noexcept;
  LazyMemory(LazyMemory&& other) noexcept;
  LazyMemory& operator=(LazyMemory&& other) noexcept;
  ~LazyMemory();
  [[nodiscard]] MutableBytes bytes() const noexcept { return bytes_; }

 private:
  MutableBytes bytes_{};
};

}  // namespace rtpm::rt
