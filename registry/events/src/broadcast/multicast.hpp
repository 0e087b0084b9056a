#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "rtpm/base/bytes.hpp"
#include "rtpm/events/event.hpp"

/// Deliveries in datagrams that one sends to many, numbered so that each receiver sees what it
/// lacks and asks for it. Knows no socket and no clock.
/// @source   spec/events.md#ev-7
namespace rtpm::events {

/// Bytes of a datagram: fits an Ethernet frame, a tunnel's, too.
inline constexpr std::size_t kMulticastDatagramMax = 1400;
inline constexpr std::size_t kMulticastHeaderSize = 32;
inline constexpr std::size_t kMulticastOwnerCountMax = 256;  ///< Of one record.

/// What stands before the owners and bytes of a datagram.
struct MulticastHeader {
  std::uint64_t id = 0;           ///< Another in each life of the hub.
  std::uint64_t sequence = 0;     ///< Of datagrams, from 0; of a heartbeat: the next one's.
  std::uint32_t record_size = 0;  ///< Bytes of the events; 0: a heartbeat.
  std::uint32_t offset = 0;       ///< Of its own bytes in them.
  std::uint16_t owner_count = 0;  ///< At offset 0: for how many subscriptions it is.
  friend bool operator==(const MulticastHeader&, const MulticastHeader&) = default;
};

/// A datagram, taken apart. Views its bytes.
struct MulticastDatagram {
  MulticastHeader header{};
  ConstBytes owners{};  ///< 4 bytes each: the lower half of the subscription's number.
  ConstBytes bytes{};
};
/// Nothing if the bytes are none.
/// @realtime alloc-free
[[nodiscard]] std::optional<MulticastDatagram> read_multicast(ConstBytes datagram) noexcept;

/// Makes datagrams and keeps the last of them.
/// @ownership its memory, taken when built
/// @threads  one at a time
/// @realtime alloc-free
class MulticastWriter {
 public:
  /// Keeps `history_count` datagrams (at least 8).
  MulticastWriter(std::uint64_t id, std::size_t history_count);

  /// Makes datagrams of `events` for `owners` (at most kMulticastOwnerCountMax) and calls
  /// send(ConstBytes) with each. False if they are more than a quarter of the history.
  template <class Send>
  [[nodiscard]] bool write(std::span<const std::uint32_t> owners, ConstBytes events, Send send) {
    if (!fits(owners.size(), events.size())) return false;
    for (std::size_t offset = 0; offset < events.size();)
      send(make(owners, events, offset));
    return true;
  }
  /// Tells who missed the last datagrams that they were there. Valid until the next call.
  [[nodiscard]] ConstBytes heartbeat() noexcept;

  /// The next datagram's sequence; the oldest's that is kept.
  [[nodiscard]] std::uint64_t next_sequence() const noexcept { return next_; }
  [[nodiscard]] std::uint64_t oldest_sequence() const noexcept {
    return next_ > places_.size() ? next_ - places_.size() : 0;
  }
  /// One that is kept; empty if it is not.
  [[nodiscard]] ConstBytes datagram(std::uint64_t sequence) const noexcept;
  [[nodiscard]] std::uint64_t id() const noexcept { return id_; }

 private:
  struct Place {
    std::size_t size = 0;
    std::byte bytes[kMulticastDatagramMax]{};
  };
  [[nodiscard]] bool fits(std::size_t owner_count, std::size_t size) const noexcept;
  [[nodiscard]] ConstBytes make(std::span<const std::uint32_t> owners, ConstBytes events,
                                std::size_t& offset) noexcept;

  std::uint64_t id_;
  std::uint64_t next_ = 0;
  std::vector<Place> places_;
  std::byte heartbeat_[kMulticastHeaderSize]{};
};

/// Puts datagrams in order again and says which are missing.
/// @ownership its memory, taken when built
/// @threads  one
/// @realtime alloc-free but for construction and records larger than any before
class MulticastReader {
 public:
  static constexpr std::size_t kWindow = 256;  ///< Datagrams that are kept behind a missing one.

  /// For the subscription `owner`, from the datagram `begin` on.
  MulticastReader(std::uint64_t id, std::uint32_t owner, std::uint64_t begin);

  /// Takes one that came, however late, repeated or out of order. False if it is none of `id`.
  [[nodiscard]] bool take(ConstBytes datagram) noexcept;
  /// The next record for the owner, in order; false: none is there. `events()` is valid until the
  /// next call.
  [[nodiscard]] bool read();
  [[nodiscard]] ConstBytes events() const noexcept { return events_; }

  /// Datagrams that are missing though later ones came: the first, and further ones, bit i being
  /// `first` + 1 + i.
  struct Gap {
    std::uint64_t first = 0;
    std::uint64_t later = 0;
  };
  [[nodiscard]] std::optional<Gap> gap() const noexcept;
  /// What the hub said when it was asked: nothing below `oldest` can be had any more, and of the
  /// datagrams below `next` there were `written_count` events for the owner.
  void note(std::uint64_t oldest, std::uint64_t next, std::uint64_t written_count) noexcept;
  /// Events of those that read() gave.
  void count_read(std::uint64_t event_count) noexcept { read_count_ += event_count; }
  /// Events that will never come, as far as is known.
  [[nodiscard]] std::uint64_t missed_count() const noexcept { return missed_count_; }

 private:
  struct Place {
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
  std::uint64_t end_;  ///< Behind the last datagram that is known of.
  std::vector<Place> places_;
  std::vector<Line> record_{};
  std::size_t record_size_ = 0;
  std::size_t filled_ = 0;
  bool is_wanted_ = false;
  ConstBytes events_{};
  std::uint64_t read_count_ = 0;
  std::uint64_t missed_count_ = 0;
  bool has_lost_ = false;
  std::optional<std::uint64_t> known_at_{};  ///< When all below was read, `known_written_` says how
  std::uint64_t known_written_ = 0;          ///< many it should have been.
};

}  // namespace rtpm::events
