#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "rtpm/events/event.hpp"

namespace rtpm::events {

/// Detects duplicate events by supplier tag, type, source and sequence. For each combination of the
/// first three, a row stores the highest sequence and which of the kSpan sequences below it
/// arrived; older events count as duplicates.
///
/// When full, it evicts a row that was silent for long; then a duplicate may pass.
/// @ownership its rows, allocated at construction
/// @realtime alloc-free, constant time
/// @source   spec/events.md#ev-5.3
class RepetitionGuard {
 public:
  static constexpr std::uint64_t kSpan = 64;

  explicit RepetitionGuard(std::size_t row_count_max = 4096);

  /// Whether the event is new. An event without tag or sequence always is.
  [[nodiscard]] bool admit(const EventHeader& header) noexcept;

 private:
  static constexpr std::size_t kSetSize = 8;
  struct Row {
    std::uint32_t tag = 0;  ///< 0 if the row is free.
    EventType type = 0;
    SourceId source = 0;
    std::uint64_t highest = 0;
    std::uint64_t seen = 0;       ///< Bit i is set if `highest - i` arrived.
    std::uint64_t last_used = 0;  ///< The number of admitted events at that time.
  };
  [[nodiscard]] Row& row_of(const EventHeader& header) noexcept;

  std::vector<Row> rows_;  ///< Set-associative, kSetSize ways.
  std::uint64_t count_ = 0;
};

}  // namespace rtpm::events
