#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>

#include "rtpm/base/bytes.hpp"
#include "rtpm/base/expected.hpp"
#include "rtpm/base/priority.hpp"
#include "rtpm/base/time.hpp"

/// Events: what suppliers push, hubs filter and consumers get. This header is their form, in memory
/// and in batches; it knows no socket, no thread and no clock.
namespace rtpm::events {

/// What kind of event it is: `rtpm_event` of a schema, 1…kEventTypeMax. Larger numbers are the
/// hub's own.
using EventType = std::uint32_t;
inline constexpr EventType kEventTypeMax = 0x7fff'ffff;
/// The type of what a filter's timeout delivers; its source is the timeout's tag.
inline constexpr EventType kTimeoutType = 0x8000'0001;
/// The type of what a hub tells of its links (rtpm/events/link.hpp); its source is the link's
/// number.
inline constexpr EventType kLinkType = 0x8000'0002;

/// Which of the suppliers of a type it is from, any number: "arm 0". There is no number for "any":
/// that is a filter's mask.
using SourceId = std::uint32_t;

/// An origin time of which nobody knows how wrong it may be.
inline constexpr std::uint32_t kUncertaintyUnknown = std::numeric_limits<std::uint32_t>::max();

/// What is known of an event apart from its content.
struct EventHeader {
  EventType type = 0;
  SourceId source = 0;
  std::uint64_t sequence = 0;               ///< Counts the events of its type and source, from 1.
  MonotonicTime origin{};                   ///< When it happened, on the hub's clock.
  MonotonicTime hub_received{};             ///< When the hub took it up,
  MonotonicTime hub_sent{};                 ///< and when it sent it on to this consumer.
  std::uint64_t schema_id = 0;              ///< Fingerprint of the payload's schema; 0: none.
  std::uint32_t origin_uncertainty_ns = 0;  ///< How far `origin` may be off.
  Priority priority{};                      ///< The supplier's.
  std::uint8_t hops_left = 0;               ///< How many further hubs may send it on.
  bool is_replayed = false;                 ///< It is older than the subscription.
  /// It and the event behind it came together: a conjunction was complete.
  bool is_continued = false;
  /// Tells suppliers apart where hubs are linked. The first hub sets it; 0: no hub had it yet.
  std::uint32_t supplier_tag = 0;
  friend bool operator==(const EventHeader&, const EventHeader&) = default;
};

/// The tag of a supplier's events in one life of a hub: another one for any other pair, as a rule,
/// and never 0.
/// @source   spec/events.md#ev-5.1-1
[[nodiscard]] constexpr std::uint32_t supplier_tag_of(std::uint64_t hub_epoch,
                                                      std::uint64_t supplier_id) noexcept {
  std::uint64_t mixed = (hub_epoch ^ supplier_id) * 0xff51'afd7'ed55'8ccdULL;
  mixed = (mixed ^ mixed >> 33 ^ hub_epoch) * 0xc4ce'b9fe'1a85'ec53ULL;
  const auto tag = static_cast<std::uint32_t>(mixed >> 32);
  return tag == 0 ? 1 : tag;
}

/// An event whose payload lies somewhere else.
/// @ownership views its payload
struct EventView {
  EventHeader header{};
  ConstBytes payload{};  ///< Opaque. Aligned to 16 bytes where RTPM hands it over.
};

/// The bytes of an encoded header, a multiple of 16 so that the payload is aligned if the header
/// is.
inline constexpr std::size_t kEventHeaderSize = 64;

/// The bytes of an event in a batch: header, payload, zeros up to a multiple of 16.
[[nodiscard]] constexpr std::size_t event_span(std::size_t payload_size) noexcept {
  return kEventHeaderSize + (payload_size + 15) / 16 * 16;
}

/// Writes one event after the other.
/// @ownership views its memory
/// @realtime alloc-free
class EventWriter {
 public:
  explicit EventWriter(MutableBytes memory) noexcept : memory_(memory) {}
  /// Appends an event; false if there is no room, and then nothing is changed.
  [[nodiscard]] bool put(const EventHeader& header, ConstBytes payload) noexcept;
  [[nodiscard]] ConstBytes bytes() const noexcept { return memory_.first(size_); }
  [[nodiscard]] std::size_t room() const noexcept { return memory_.size() - size_; }
  void clear() noexcept { size_ = 0; }

 private:
  MutableBytes memory_;
  std::size_t size_ = 0;
};

/// Why there is no next event.
enum class EventError : std::uint8_t {
  kEnd,     ///< All were read.
  kBroken,  ///< The bytes are no events from here on. Drop the rest and count it.
};

/// Reads untrusted bytes as one event after the other.
/// @ownership views its bytes, and so do the payloads
/// @realtime alloc-free
class EventReader {
 public:
  explicit EventReader(ConstBytes bytes) noexcept : bytes_(bytes) {}
  [[nodiscard]] expected<EventView, EventError> next() noexcept;

 private:
  ConstBytes bytes_;
};

}  // namespace rtpm::events
