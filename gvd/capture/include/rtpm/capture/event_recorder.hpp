#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <utility>

#include "rtpm/capture/event_schemas.hpp"
#include "rtpm/events/event.hpp"
#include "rtpm/recording/recorder.hpp"

namespace rtpm::capture {

/// Records events, each type and source in a channel of its own: topic "lab.Touched/3", the
/// schema embedded. The payload is a FlatBuffer whose root is the event's table. Sequence and
/// origin are the message's sequence and publish time; the log time is when it came here.
/// @ownership refers to its recorder, which other sources may share
/// @threads  one; record() allocates and is not for real-time threads
class EventRecorder {
 public:
  /// Takes a track of its own.
  explicit EventRecorder(recording::Recorder& recorder);
  EventRecorder(const EventRecorder&) = delete;
  EventRecorder& operator=(const EventRecorder&) = delete;
  ~EventRecorder() = default;

  /// Records one event. What the recorder can't take it counts.
  /// @param type  null while the type is not known
  void record(const events::EventView& event, const events::EventDescriptor* type);

 private:
  struct ChannelOfEvents {
    std::uint16_t number = 0;
    schema::Dynamic* dynamic = nullptr;  ///< Null: the payload is recorded as it is.
  };
  /// Null: the file takes no more channels.
  ChannelOfEvents* channel_of(const events::EventHeader& header,
                              const events::EventDescriptor* type);
  std::optional<std::uint16_t> add_channel(const events::EventHeader& header,
                                           const events::EventDescriptor* type,
                                           const schema::Dynamic* dynamic);

  recording::Recorder& recorder_;
  recording::Recorder::Track& track_;
  EventSchemas schemas_{};
  std::map<std::pair<events::EventType, events::SourceId>, ChannelOfEvents> channels_{};
};

}  // namespace rtpm::capture
