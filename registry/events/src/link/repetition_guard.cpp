#include "link/repetition_guard.hpp"

#include <algorithm>
#include <bit>
#include <span>

namespace rtpm::events {

RepetitionGuard::RepetitionGuard(std::size_t row_count_max)
    : rows_(std::max(std::bit_ceil(row_count_max), kSetSize)) {}

RepetitionGuard::Row& RepetitionGuard::row_of(const EventHeader& header) noexcept {
  std::uint64_t mixed = (std::uint64_t{header.type} << 32 | header.source) ^
                        std::uint64_t{header.supplier_tag} * 0x9e37'79b9'7f4a'7c15ULL;
  mixed *= 0xff51'afd7'ed55'8ccdULL;
  const std::size_t set = static_cast<std::size_t>(mixed >> 32) & (rows_.size() / kSetSize - 1);
  Row* oldest = nullptr;
  for (Row& row : std::span(rows_).subspan(set * kSetSize, kSetSize)) {
    if (row.tag == header.supplier_tag && row.type == header.type && row.source == header.source) {
      return row;
    }
    if (oldest == nullptr || row.last_used < oldest->last_used) oldest = &row;
  }
  *oldest = {.tag = header.supplier_tag, .type = header.type, .source = header.source};
  return *oldest;
}

// ev-5.3-2: a row covers one supplier, type and source.
bool RepetitionGuard::admit(const EventHeader& header) noexcept {
  if (header.supplier_tag == 0 || header.sequence == 0) return true;
  Row& row = row_of(header);
  row.last_used = ++count_;
  if (header.sequence > row.highest) {
    const std::uint64_t ahead = header.sequence - row.highest;
    row.seen = ahead < kSpan ? row.seen << ahead | 1 : 1;
    row.highest = header.sequence;
    return true;
  }
  const std::uint64_t behind = row.highest - header.sequence;
  if (behind >= kSpan || (row.seen >> behind & 1) != 0) return false;
  row.seen |= std::uint64_t{1} << behind;
  return true;
}

}  // namespace rtpm::events
