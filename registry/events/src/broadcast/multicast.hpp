#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "rtpm/base/bytes.hpp"
#include "rtpm/events/event.hpp"

/// Deliveries in numbered multicast datagrams; receivers detect gaps and request repair. Uses no
/// socket and no clock.
/// @source   spec/events.md#ev-7
namespace rtpm::events {

/// The size of a datagram in bytes; fits an Ethernet frame, even tunnelled.
inline constexpr std::size_t kMulticastDatagramMax = 1400;
inline constexpr std::size_t kMulticastHeaderSize = 32;
inline constexpr std::size_t kMulticastOwnerCountMax = 256;  ///< Limit per record.

/// The header of a datagram.
struct MulticastHeader {
  std::uint64_t id = 0;           ///< Changes at each start of the hub.
  std::uint64_t sequence = 0;     ///< The datagram's number, from 0; in a heartbeat, the next one.
  std::uint32_t record_size = 0;  ///< Bytes of the events; 0 for a heartbeat.
  std::uint32_t offset = 0;       ///< Offset of this datagram's bytes in the record.
  std::uint16_t owner_count = 0;  ///< Number of owners, at offset 0 only.
  friend bool operator==(const MulticastHeader&, const MulticastHeader&) = default;
};

/// A decoded datagram; refers to its bytes.
struct MulticastDatagram {
  MulticastHeader header{};
  ConstBytes owners{};  ///< 4 bytes each: the lower half of the subscription's number.
  ConstBytes bytes{};
};
/// Decodes a datagram; nullopt if malformed.
[[nodiscard]] std::optional<MulticastDatagram> read_multicast(ConstBytes datagram) noexcept;

/// Encodes datagrams and keeps a history of them.
/// @ownership its memory, allocated when built
class MulticastWriter {
 public:
  /// Creates a history of `history_count` datagrams (at least 8).
  MulticastWriter(std::uint64_t id, std::size_t history_count);

  /// Encodes `events` for `owners` (at most kMulticastOwnerCountMax) and calls send(ConstBytes) for
  /// each datagram; false if they take more than a quarter of the history.
  template <class Send>
  [[nodiscard]] bool write(std::span<const std::uint32_t> owners, ConstBytes events, Send send) {
    if (!fits(owners.size(), events.size())) return false;
    for (std::size_t offset = 0; offset < events.size();)
      send(make(owners, events, offset));
    return true;
  }
  /// A heartbeat, which reveals the loss of the last datagrams. Valid until the next call.
  [[nodiscard]] ConstBytes heartbeat() noexcept;

  /// The sequence of the next datagram; then that of the oldest one kept.
  [[nodiscard]] std::uint64_t next_sequence() const noexcept { return next_; }
  [[nodiscard]] std::uint64_t oldest_sequence() const noexcept {
    return next_ > slots_.size() ? next_ - slots_.size() : 0;
  }
  /// A kept datagram; empty if evicted.
  [[nodiscard]] ConstBytes datagram(std::uint64_t sequence) const noexcept;
  [[nodiscard]] std::uint64_t id() const noexcept { return id_; }

 private:
  struct Slot {
    std::size_t size = 0;
    std::byte bytes[kMulticastDatagramMax]{};
  };
  [[nodiscard]] bool fits(std::size_t owner_count, std::size_t size) const noexcept;
  [[nodiscard]] ConstBytes make(std::span<const std::uint32_t> owners, ConstBytes events,
                                std::size_t& offset) noexcept;

  std::uint64_t id_;
  std::uint64_t next_ = 0;
  std::vector<Slot> slots_;
  std::byte heartbeat_[kMulticastHeaderSize]{};
};

/// Reorders datagrams and detects gaps.
/// @ownership its memory, allocated when built
/// @realtime alloc-free except construction and records larger than any before
class MulticastReader {
 public:
  static constexpr std::size_t kWindow = 256;  ///< Datagrams kept after a missing one.

  /// Reads for subscription `owner`, from datagram `begin` on.
  MulticastReader(std::uint64_t id, std::uint32_t owner, std::uint64_t begin);

  /// Accepts a datagram, in any order, possibly duplicated; false if its id differs from `id`.
  [[nodiscard]] bool take(ConstBytes datagram) noexcept;
  /// Reads the owner's next record, in order; false if there is none. `events()` is valid until the
  /// next call.
  [[nodiscard]] bool read();
  [[nodiscard]] ConstBytes events() const noexcept { return events_; }

  /// Missing datagrams: `first`, and `first` + 1 + i if bit i of `later` is set.
  struct Gap {
    std::uint64_t first = 0;
    std::uint64_t later = 0;
  };
  [[nodiscard]] std::optional<Gap> gap() const noexcept;
  /// Handles the hub's answer: datagrams below `oldest` are evicted, and those below `next`
  /// contained `written_count` events for the owner.
  void note(std::uint64_t oldest, std::uint64_t next, std::uint64_t written_count) noexcept;
  /// Counts events that read() returned.
  void count_read(std::uint64_t event_count) noexcept { read_count_ += event_count; }
  /// Events known to be lost.
  [[nodiscard]] std::uint64_t missed_count() const noexcept { return missed_count_; }

 private:
  struct Slot {
    std::uint64_t sequence = ~std::uint64_t{0};
    std::size_t size = 0;
    std::byte bytes[kMulticastDatagramMax]{};
  };
  struct alignas(16) Line {
    std::byte bytes[16];
  };
  [[nodiscard]] bool append(const MulticastDatagram& datagram);

  std::uint64_t id_;
  std::uint32_t owner_;
  std::uint64_t expected_;
  std::uint64_t end_;  ///< The position after the last known datagram.
  std::vector<Slot> slots_;
  std::vector<Line> record_{};
  std::size_t record_size_ = 0;
  std::size_t filled_ = 0;
  bool is_wanted_ = false;
  ConstBytes events_{};
  std::uint64_t read_count_ = 0;
  std::uint64_t missed_count_ = 0;
  bool has_lost_ = false;
  /// When all datagrams below this position are read, the owner should have had `known_written_`
  /// events.
  std::optional<std::uint64_t> known_at_{};
  std::uint64_t known_written_ = 0;
};

}  // namespace rtpm::events
