#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "rtpm/base/time.hpp"

namespace rtpm::discovery {

/// How many answers a program gives: to a host, and in all.
/// @source   spec/hprotocol.md#hp-10.1
/// @threads  one
class AnswerLimit {
 public:
  static constexpr std::uint32_t kPerHostAndSecond = 20;
  static constexpr std::uint32_t kInAllPerSecond = 200;

  /// Whether the host may be answered now.
  [[nodiscard]] bool admit(std::uint32_t host, MonotonicTime now) noexcept;

 private:
  /// So many in the second that began then.
  struct Count {
    std::uint32_t count = 0;
    MonotonicTime begin{};
    [[nodiscard]] bool admit(std::uint32_t count_max, MonotonicTime now) noexcept;
  };
  /// Further hosts share a place with others.
  std::array<Count, 256> hosts_{};
  Count all_{};
};

}  // namespace rtpm::discovery
