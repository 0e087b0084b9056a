#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "rtpm/capture/event_schemas.hpp"
#include "rtpm/events/event.hpp"
#include "rtpm/recording/recorder.hpp"
#include "rtpm/rt/pi_mutex.hpp"

namespace rtpm::capture {

/// Records events, each type and source in a channel of its own: topic "lab.Touched/3", of a device
/// whose name is known "lab/arm0/sampled", the schema embedded. The payload is a FlatBuffer whose
/// root is the event's table. Sequence and origin are the message's sequence and publish time; the
/// log time is when it came here.
/// @ownership refers to its recorder, which other sources may share
/// @threads  record() on one, the rest on any; allocates and waits, so none of real time
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

  /// Names the channels of these devices. Earlier events of theirs stay in channels by number.
  void name_devices(std::span<const std::string> names);
  /// The named devices whose first event came since the last call.
  [[nodiscard]] std::vector<std::string> take_new_devices();
  /// Whether an event of a device without a name came since the last call, the first of its source.
  [[nodiscard]] bool take_new_unnamed();

 private:
  struct ChannelOfEvents {
    std::uint16_t number = 0;
    schema::Dynamic* dynamic = nullptr;  ///< Null: the payload is recorded as it is.
    bool is_named = false;               ///< By its device.
  };
  /// Null: the file takes no more channels.
  ChannelOfEvents* channel_of(const events::EventHeader& header,
                              const events::EventDescriptor* type);
  std::optional<std::uint16_t> add_channel(const events::EventHeader& header,
                                           const events::EventDescriptor* type,
                                           const schema::Dynamic* dynamic,
                                           const std::string* device);
  /// Null: no device's, or of one without a name.
  const std::string* device_of(const events::EventHeader& header);

  rt::PiMutex mutex_{};
  recording::Recorder& recorder_;
  recording::Recorder::Track& track_;
  EventSchemas schemas_{};
  std::map<std::pair<events::EventType, events::SourceId>, ChannelOfEvents> channels_{};
  std::map<events::SourceId, std::string> devices_{};
  std::set<events::SourceId> seen_devices_{};
  std::set<events::SourceId> seen_unnamed_{};
  std::vector<std::string> new_devices_{};
  bool has_new_unnamed_ = false;
};

}  // namespace rtpm::capture
