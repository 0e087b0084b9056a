#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "rtpm/events/event.hpp"

namespace rtpm::events {

/// Tells events that are new from those that came before by another way. It knows them by their
/// supplier's tag, type, source and sequence, and remembers for each such row of sequences the
/// highest and which of the kSpan below it came; what is older counts as repeated.
///
/// Of more rows than it has places for it forgets one that was silent for long; then a repeated
/// event may pass.
/// @ownership its places, taken when built
/// @threads  one at a time
/// @realtime alloc-free, constant
/// @source   spec/events.md#ev-5.3
class RepetitionGuard {
 public:
  static constexpr std::uint64_t kSpan = 64;

  explicit RepetitionGuard(std::size_t row_count_max = 4096);

  /// Whether it is new; from then on it is not. An event without tag or sequence is always new.
  [[nodiscard]] bool admit(const EventHeader& header) noexcept;

 private:
  static constexpr std::size_t kSetSize = 8;
  struct Row {
    std::uint32_t tag = 0;  ///< 0: the place is free.
    EventType type = 0;
    SourceId source = 0;
    std::uint64_t highest = 0;
    std::uint64_t seen = 0;       ///< Bit i: `highest - i` came.
    std::uint64_t last_used = 0;  ///< By the count of all events.
  };
  [[nodiscard]] Row& row_of(const EventHeader& header) noexcept;

  std::vector<Row> rows_;  ///< Sets of kSetSize, one of which a key may stand in.
  std::uint64_t count_ = 0;
};

}  // namespace rtpm::events
