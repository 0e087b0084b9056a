#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "rtpm/base/time.hpp"

namespace rtpm::discovery {

/// Limits a program's answers: per host, and in total.
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
  /// If there are more hosts, several share an entry.
  std::array<Count, 256> hosts_{};
  Count all_{};
};

}  // namespace rtpm::discovery
