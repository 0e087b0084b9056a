#pragma once

#include <cstdint>
#include <cstring>
#include <string>
#include <utility>
#include <vector>

#include "rtpm/base/bytes.hpp"
#include "rtpm/base/setup_error.hpp"
#include "rtpm/events/scalar.hpp"
#include "rtpm/recording/file_reader.hpp"
#include "rtpm/rpc/tables.hpp"

namespace rtpm::capture {

/// An event in a recording.
/// @ownership views the message, which lives until the visitor returns
template <class Event>
struct RecordedEventOf {
  const typename Event::Payload& payload;
  const recording::Channel& channel;  ///< Its topic, such as "lab/arm0/sampled", and metadata.
  std::uint32_t sequence = 0;         ///< The source's count.
  std::uint64_t log_time_ns = 0;      ///< When it was recorded, since 1970 in UTC.
  std::uint64_t publish_time_ns = 0;  ///< Its origin.
};

/// The channels that contain events of this type.
/// @errors   a channel was recorded with another version of the type's schema
[[nodiscard]] expected<std::vector<std::uint16_t>, SetupError> channels_of_event(
    const recording::FileReader& reader, const events::EventDescriptor& type);

/// Extracts the struct that is a table's only field, as events of bare structs are recorded.
/// @return   empty if the bytes are malformed
[[nodiscard]] ConstBytes struct_in_table(ConstBytes table, std::size_t size) noexcept;

/// Calls `visit(event)` for each event of a type, such as `lab::TouchedEvent` of
/// `<lab.rtpm.events.hpp>`, in order of time, until it returns false.
/// @param query  if it names no channels, all channels of the type
/// @errors   the file has no such event, or one of another version of the type's schema; a
///           malformed message; those of FileReader::read()
/// @realtime never
template <class Event, class Visit>
[[nodiscard]] expected<void, SetupError> read_events(recording::FileReader& reader,
                                                     const Visit& visit,
                                                     recording::Query query = {}) {
  using Payload = typename Event::Payload;
  auto channels = channels_of_event(reader, Event::kDescriptor);
  if (!channels) return unexpected{channels.error()};
  if (query.channel_ids.empty()) query.channel_ids = std::move(*channels);
  bool is_broken = false;
  auto read = reader.read(query, [&](const recording::Message& message) {
    const auto show = [&](const Payload& payload) {
      return visit(RecordedEventOf<Event>{payload, reader.channels().at(message.channel_id),
                                          message.sequence, message.log_time_ns,
                                          message.publish_time_ns});
    };
    if constexpr (Event::kIsStruct) {
      const ConstBytes bytes = struct_in_table(message.data, sizeof(Payload));
      is_broken = bytes.empty();
      if (is_broken) return false;
      Payload payload;
      std::memcpy(&payload, bytes.data(), sizeof payload);
      return show(payload);
    } else {
      // FlatBuffers must be read from aligned memory.
      const std::vector<std::byte> table(message.data.begin(), message.data.end());
      is_broken = !rpc::is_valid_table<Payload>(table, Event::kLimits);
      return !is_broken && show(*flatbuffers::GetRoot<Payload>(table.data()));
    }
  });
  if (!read) return read;
  if (!is_broken) return {};
  return setup_error("an event " + std::string(Event::kDescriptor.name) + " is broken", "",
                     "see what else is: rtpm bag check");
}

}  // namespace rtpm::capture
