#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <vector>

#include "rtpm/events/event.hpp"

namespace rtpm::events {

/// Reassembles deliveries and large events from stream items.
/// @threads  one at a time. Allocates only for data that spans items
class Assembler {
 public:
  /// `event_size_max`: larger events are refused.
  explicit Assembler(std::size_t event_size_max) : event_size_max_(event_size_max) {}

  /// Processes encoded events; calls deliver(span of EventView) for each complete delivery. False
  /// if malformed.
  template <class Deliver>
  [[nodiscard]] bool take(ConstBytes bytes, Deliver deliver) {
    EventReader reader(aligned(bytes));
    auto event = reader.next();
    for (; event; event = reader.next()) {
      group_.push_back(*event);
      if (event->header.is_continued && group_.size() < kGroupSizeLimit) continue;
      deliver(std::span<const EventView>(group_));
      group_.clear();
      kept_.clear();
    }
    keep_group();
    return event.error() == EventError::kEnd;
  }
  /// Processes a part of an event of `size` bytes, including the header. False if malformed or out
  /// of order.
  template <class Deliver>
  [[nodiscard]] bool take_part(ConstBytes bytes, std::size_t offset, std::size_t size,
                               Deliver deliver) {
    if (size > event_size_max_ || offset != part_size_ || bytes.size() > size - offset) {
      part_size_ = 0;
      return false;
    }
    part_.resize((size + sizeof(Line) - 1) / sizeof(Line));
    std::memcpy(as_bytes(part_) + offset, bytes.data(), bytes.size());
    part_size_ += bytes.size();
    if (part_size_ < size) return true;
    part_size_ = 0;
    return take({as_bytes(part_), size}, deliver);
  }
  /// Drops incomplete deliveries, for a new subscription.
  void clear() {
    group_.clear();
    kept_.clear();
    part_size_ = 0;
  }

 private:
  struct alignas(16) Line {
    std::byte bytes[16];
  };
  using Lines = std::vector<Line>;
  static constexpr std::size_t kGroupSizeLimit = 64;

  [[nodiscard]] static std::byte* as_bytes(Lines& lines) noexcept { return lines.data()->bytes; }
  [[nodiscard]] ConstBytes aligned(ConstBytes bytes) {
    if (reinterpret_cast<std::uintptr_t>(bytes.data()) % alignof(Line) == 0) return bytes;
    return copy(bytes, shifted_);
  }
  [[nodiscard]] static ConstBytes copy(ConstBytes bytes, Lines& to) {
    to.resize((bytes.size() + sizeof(Line) - 1) / sizeof(Line) + 1);
    if (!bytes.empty()) std::memcpy(as_bytes(to), bytes.data(), bytes.size());
    return {as_bytes(to), bytes.size()};
  }
  // Copies the payloads of an incomplete delivery, because their item is about to be freed.
  void keep_group() {
    while (kept_.size() < group_.size()) {
      EventView& event = group_[kept_.size()];
      event.payload = copy(event.payload, kept_.emplace_back());
    }
  }

  std::size_t event_size_max_;
  std::vector<EventView> group_{};
  std::vector<Lines> kept_{};  ///< The payloads of the first events of group_.
  Lines shifted_{};
  Lines part_{};
  std::size_t part_size_ = 0;
};

}  // namespace rtpm::events
