#include "rtpm/events/event.hpp"

#include <cstring>

namespace rtpm::events {
namespace {

constexpr std::uint8_t kFlagReplayed = 1;
constexpr std::uint8_t kFlagContinued = 2;

std::uint64_t bits_of(MonotonicTime time) noexcept {
  return static_cast<std::uint64_t>(to_ns(time));
}

MonotonicTime time_of(std::uint64_t bits) noexcept {
  return time_from_ns(static_cast<std::int64_t>(bits));
}

}  // namespace

bool EventWriter::put(const EventHeader& header, ConstBytes payload) noexcept {
  const std::size_t span = event_span(payload.size());
  if (span > room()) return false;
  ByteWriter writer(memory_.subspan(size_, span));
  writer.put(header.type);
  writer.put(header.source);
  writer.put(header.sequence);
  writer.put(bits_of(header.origin));
  writer.put(bits_of(header.hub_received));
  writer.put(bits_of(header.hub_sent));
  writer.put(header.schema_id);
  writer.put(static_cast<std::uint32_t>(payload.size()));
  writer.put(header.origin_uncertainty_ns);
  writer.put(header.priority.value());
  writer.put(header.hops_left);
  writer.put(static_cast<std::uint8_t>((header.is_replayed ? kFlagReplayed : 0) |
                                       (header.is_continued ? kFlagContinued : 0)));
  writer.put(header.supplier_tag);
  writer.put_bytes(payload);
  writer.put_zeros(span - kEventHeaderSize - payload.size());
  size_ += span;
  return true;
}

// ev-2-1
expected<EventView, EventError> EventReader::next() noexcept {
  if (bytes_.empty()) return unexpected{EventError::kEnd};
  ByteReader reader(bytes_);
  EventView event;
  event.header.type = reader.take<std::uint32_t>();
  event.header.source = reader.take<std::uint32_t>();
  event.header.sequence = reader.take<std::uint64_t>();
  event.header.origin = time_of(reader.take<std::uint64_t>());
  event.header.hub_received = time_of(reader.take<std::uint64_t>());
  event.header.hub_sent = time_of(reader.take<std::uint64_t>());
  event.header.schema_id = reader.take<std::uint64_t>();
  const auto payload_size = reader.take<std::uint32_t>();
  event.header.origin_uncertainty_ns = reader.take<std::uint32_t>();
  const auto priority = reader.take<std::uint16_t>();
  event.header.hops_left = reader.take<std::uint8_t>();
  const auto flags = reader.take<std::uint8_t>();
  event.header.supplier_tag = reader.take<std::uint32_t>();
  const bool is_sound = reader.ok() && Priority::is_valid(priority) &&
                        (flags & ~(kFlagReplayed | kFlagContinued)) == 0 &&
                        event.header.type != 0 && payload_size <= reader.left();
  if (!is_sound) return unexpected{EventError::kBroken};
  event.header.priority = Priority(priority);
  event.header.is_replayed = (flags & kFlagReplayed) != 0;
  event.header.is_continued = (flags & kFlagContinued) != 0;
  event.payload = reader.take_bytes(payload_size);
  // The last event's padding is optional.
  bytes_ = bytes_.subspan(std::min(bytes_.size(), event_span(payload_size)));
  return event;
}

}  // namespace rtpm::events
