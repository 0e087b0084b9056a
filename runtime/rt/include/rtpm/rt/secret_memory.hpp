#pragma once

#include <cstddef>

#include "rtpm/base/bytes.hpp"

namespace rtpm::rt {

/// Memory for keys: locked, so that it is never swapped out; left out of core dumps; zeros in a
/// forked child; wiped on destruction. If the system refuses to lock it, the setup report shows
/// that; everything else still holds.
/// @ownership unmaps on destruction
/// @threads   like any memory; set-up only
class SecretMemory {
 public:
  SecretMemory() noexcept = default;
  /// Allocates zeros, resident, aligned to a page. Empty if the system has no memory left, or can't
  /// hide it from a child.
  explicit SecretMemory(std::size_t size);
  SecretMemory(SecretMemory&& other) noexcept;
  SecretMemory& operator=(SecretMemory&& other) noexcept;
  ~SecretMemory();
  [[nodiscard]] MutableBytes bytes() const noexcept { return bytes_; }

 private:
  MutableBytes bytes_{};
};

}  // namespace rtpm::rt
