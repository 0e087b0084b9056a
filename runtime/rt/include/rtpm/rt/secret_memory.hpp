#pragma once

#include <cstddef>

#include "rtpm/base/bytes.hpp"

namespace rtpm::rt {

/// Memory for keys: locked, so that it is never swapped out; left out of core dumps; zeros in the
/// child of a fork; wiped at its end. If the system refuses to lock it, the setup report shows
/// that; everything else still holds.
/// @ownership unmaps at its end
/// @threads   as any memory. Set-up only
class SecretMemory {
 public:
  SecretMemory() noexcept = default;
  /// Zeros, resident, aligned to a page. Empty if the system has no memory left, or can't hide it
  /// from a child.
  explicit SecretMemory(std::size_t size);
  SecretMemory(SecretMemory&& other) noexcept;
  SecretMemory& operator=(SecretMemory&& other) noexcept;
  ~SecretMemory();
  [[nodiscard]] MutableBytes bytes() const noexcept { return bytes_; }

 private:
  MutableBytes bytes_{};
};

}  // namespace rtpm::rt
