#pragma once

#include <array>
#include <cstdint>

namespace rtpm::crypto {

/// Records which of the last kSize counters of a session were received, in constant memory.
/// @threads  one at a time
/// @realtime alloc-free, a few ns
/// @source   RFC 6479: blocks of bits, cleared one by one when jumping ahead
class ReplayWindow {
 public:
  static constexpr std::uint64_t kSize = 1024;

  /// Whether `counter` was not received yet; counters older than the window count as received.
  [[nodiscard]] bool is_new(std::uint64_t counter) const noexcept;
  /// Records that `counter` was received. Call it for an authentic frame whose counter is_new().
  void add(std::uint64_t counter) noexcept;
  /// One more than the largest counter received; 0 initially.
  [[nodiscard]] std::uint64_t next() const noexcept { return next_; }

 private:
  static constexpr std::uint64_t kBlockBits = 64;
  // One block more than the window, so that a whole block can be cleared.
  static constexpr std::uint64_t kBlocks = kSize / kBlockBits + 1;

  std::uint64_t next_ = 0;
  std::array<std::uint64_t, kBlocks> bits_{};
};

}  // namespace rtpm::crypto
