#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "rtpm/base/time.hpp"

namespace rtpm::discovery {

/// Limits the answers that a program gives: to a host, and in total.
/// @source   spec/hprotocol.md#hp-10.1
/// @threads  one
class AnswerLimit {
 public:
  static constexpr std::uint32_t kPerHostAndSecond = 20;
  static constexpr std::uint32_t kInAllPerSecond = 200;

  /// Whether the host may be answered now; if so, counts the answer.
  [[nodiscard]] bool admit(std::uint32_t host, MonotonicTime now) noexcept;

 private:
  /// The number of answers in the second that started at `begin`.
  struct Count {
    std::uint32_t count = 0;
    MonotonicTime begin{};
    [[nodiscard]] bool admit(std::uint32_t count_max, MonotonicTime now) noexcept;
  };
  /// Additional hosts share an entry with other hosts.
  std::array<Count, 256> hosts_{};
  Count all_{};
};

}  // namespace rtpm::discovery
