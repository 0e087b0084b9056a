#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>

#include "rtpm/base/bytes.hpp"
#include "rtpm/base/expected.hpp"
#include "rtpm/base/priority.hpp"
#include "rtpm/base/time.hpp"

/// Events in memory and in encoded batches. Uses no socket, thread or clock.
namespace rtpm::events {

/// The type of an event: `rtpm_event` in a schema, 1…kEventTypeMax. Larger numbers belong to the
/// hub.
using EventType = std::uint32_t;
inline constexpr EventType kEventTypeMax = 0x7fff'ffff;
/// The event of a filter's timeout; its source is the timeout's tag.
inline constexpr EventType kTimeoutType = 0x8000'0001;
/// The event with which a hub reports on a link (LinkReport); its source is the link's number.
inline constexpr EventType kLinkType = 0x8000'0002;

/// Distinguishes the suppliers of a type, such as "arm 0". Any number is valid, including 0.
using SourceId = std::uint32_t;

/// The origin time has an unknown uncertainty.
inline constexpr std::uint32_t kUncertaintyUnknown = std::numeric_limits<std::uint32_t>::max();

/// Metadata of an event.
struct EventHeader {
  EventType type = 0;
  SourceId source = 0;
  std::uint64_t sequence = 0;    ///< Per supplier, type and source, from 1; 0 if not counted.
  MonotonicTime origin{};        ///< When it occurred, on the hub's clock.
  MonotonicTime hub_received{};  ///< When the hub received it.
  MonotonicTime hub_sent{};      ///< When the hub sent it to this consumer.
  std::uint64_t schema_id = 0;   ///< Fingerprint of the payload's schema; 0 if none.
  std::uint32_t origin_uncertainty_ns = 0;  ///< Error bound of `origin`.
  Priority priority{};                      ///< The supplier's priority.
  std::uint8_t hops_left = 0;               ///< How many further hubs may forward it.
  bool is_replayed = false;                 ///< Older than the subscription.
  /// The next event belongs to the same delivery of a conjunction.
  bool is_continued = false;
  /// Identifies the supplier across linked hubs; set by the first hub, 0 before that.
  std::uint32_t supplier_tag = 0;
  friend bool operator==(const EventHeader&, const EventHeader&) = default;
};

/// The supplier_tag of a supplier at a hub: a hash of both, never 0.
/// @source   spec/events.md#ev-5.1-1
[[nodiscard]] constexpr std::uint32_t supplier_tag_of(std::uint64_t hub_epoch,
                                                      std::uint64_t supplier_id) noexcept {
  std::uint64_t mixed = (hub_epoch ^ supplier_id) * 0xff51'afd7'ed55'8ccdULL;
  mixed = (mixed ^ mixed >> 33 ^ hub_epoch) * 0xc4ce'b9fe'1a85'ec53ULL;
  const auto tag = static_cast<std::uint32_t>(mixed >> 32);
  return tag == 0 ? 1 : tag;
}

/// An event that refers to its payload.
/// @ownership does not own the payload
struct EventView {
  EventHeader header{};
  ConstBytes payload{};  ///< Opaque. Aligned to 16 bytes in handlers.
};

/// The size of an encoded header in bytes; a multiple of 16 keeps the payload aligned.
inline constexpr std::size_t kEventHeaderSize = 64;

/// The size of an event in a batch, in bytes: header, payload, zeros up to a multiple of 16.
[[nodiscard]] constexpr std::size_t event_span(std::size_t payload_size) noexcept {
  return kEventHeaderSize + (payload_size + 15) / 16 * 16;
}

/// Encodes a sequence of events.
/// @ownership views its memory
/// @realtime alloc-free
class EventWriter {
 public:
  explicit EventWriter(MutableBytes memory) noexcept : memory_(memory) {}
  /// Appends an event; false, without any change, if it does not fit.
  [[nodiscard]] bool put(const EventHeader& header, ConstBytes payload) noexcept;
  [[nodiscard]] ConstBytes bytes() const noexcept { return memory_.first(size_); }
  [[nodiscard]] std::size_t room() const noexcept { return memory_.size() - size_; }
  void clear() noexcept { size_ = 0; }

 private:
  MutableBytes memory_;
  std::size_t size_ = 0;
};

/// Why EventReader::next() returned no event.
enum class EventError : std::uint8_t {
  kEnd,     ///< All events were read.
  kBroken,  ///< The rest is malformed: drop and count it.
};

/// Decodes a sequence of events from untrusted bytes.
/// @ownership reader and payloads refer to the bytes
/// @realtime alloc-free
class EventReader {
 public:
  explicit EventReader(ConstBytes bytes) noexcept : bytes_(bytes) {}
  [[nodiscard]] expected<EventView, EventError> next() noexcept;

 private:
  ConstBytes bytes_;
};

}  // namespace rtpm::events
