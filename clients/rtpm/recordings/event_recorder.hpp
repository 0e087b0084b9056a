#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <utility>

#include "events/event_schemas.hpp"
#include "events/subscription.hpp"
#include "rtpm/recording/recorder.hpp"

namespace rtpm::tool {

/// Records events, each type and source in a channel of its own: topic "lab.Touched/3", the
/// schema embedded. The payload is a FlatBuffer whose root is the event's table. Sequence and
/// origin are the message's sequence and publish time; the log time is when it came here.
/// @threads  on_event() on one
class EventRecorder final : public Subscription::Observer {
 public:
  /// @errors   as recording::Recorder::create()
  [[nodiscard]] static expected<std::unique_ptr<EventRecorder>, SetupError> create(
      const std::string& path, const recording::RecorderConfig& config);

  void on_event(const events::EventView& event, const events::EventDescriptor* type) override;

  [[nodiscard]] recording::Recorder& recorder() noexcept { return *recorder_; }

 private:
  explicit EventRecorder(std::unique_ptr<recording::Recorder> recorder);

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

  std::unique_ptr<recording::Recorder> recorder_;
  recording::Recorder::Track& track_;
  EventSchemas schemas_{};
  std::map<std::pair<events::EventType, events::SourceId>, ChannelOfEvents> channels_{};
};

}  // namespace rtpm::tool
