#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "rtpm/base/bytes.hpp"
#include "rtpm/base/setup_error.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/capture/event_schemas.hpp"
#include "rtpm/events/event.hpp"
#include "rtpm/recording/recorder.hpp"
#include "rtpm/rt/pi_mutex.hpp"
#include "view_recorder.hpp"

namespace rtpm::capture {

/// The known descriptors, as events::HubTypes::list() returns them.
using KnownTypes = std::span<const events::EventDescriptor* const>;

/// Records events, with a channel and schema for each type and source: topic "lab.Touched/3", or
/// "lab/arm0/sampled" for a device whose name is known. The payload is a FlatBuffer whose root is
/// the event's table. Sequence and origin become the message's sequence and publish time; the log
/// time is the time of arrival.
///
/// A program's first events may arrive before its types and names are known here. They are held
/// back, at most kHoldTimeMax and kHeldByteMax in all, so that they get into the right channel.
/// @ownership refers to its recorder, which other sources may share
/// @threads  record(): one; the rest: any. Allocates and waits, so not for real-time threads
class EventRecorder {
 public:
  static constexpr Duration kHoldTimeMax = std::chrono::seconds{3};
  /// The amount that a track accepts at once, so that no held event is dropped when it is recorded.
  static constexpr std::size_t kHeldByteMax = 2 << 20;

  /// Uses its own track.
  /// @param names_devices  whether name_devices() will be called; events then wait for it
  explicit EventRecorder(recording::Recorder& recorder, bool names_devices = false);
  EventRecorder(const EventRecorder&) = delete;
  EventRecorder& operator=(const EventRecorder&) = delete;
  ~EventRecorder() = default;

  /// Records one event; if the recorder can't take it, it counts as dropped.
  /// @param type           null while the type is not known
  /// @param is_hub_local   the hub's clock is this host's: the origin is exact. Otherwise it is late by
  ///                       the transit from the hub
  void record(const events::EventView& event, const events::EventDescriptor* type,
              bool is_hub_local = false);
  /// Records held events whose type and name are known now, or that have waited for too long. Call
  /// it regularly.
  void attend(KnownTypes types);
  /// Records all held events. Call it before the recorder is closed.
  void finish(KnownTypes types);
  /// Whether events are held back, so that the caller should ask for types and names.
  [[nodiscard]] bool is_holding() const;

  /// Names the channels of these devices. Their earlier events stay in channels by number.
  void name_devices(std::span<const std::string> names);
  /// Records what viewers draw of the device, from now on.
  void add_view(const std::string& device, const driver::Descriptor& descriptor);
  /// The named devices whose first event arrived since the last call.
  [[nodiscard]] std::vector<std::string> take_new_devices();
  /// Whether device names are missing: events are waiting for one, or a device without a name sent
  /// its first event since the last call.
  [[nodiscard]] bool take_new_unnamed();

 private:
  struct ChannelOfEvents {
    std::uint16_t number = 0;
    schema::Dynamic* dynamic = nullptr;  ///< If null, the payload is recorded as it is.
    bool is_named = false;               ///< The channel's topic has the device's name.
  };
  using Key = std::pair<events::EventType, events::SourceId>;
  struct Held {
    events::EventHeader header{};
    std::vector<std::byte> payload{};
    MonotonicTime received{};
    MonotonicTime origin{};  ///< By this host's clock.
  };
  /// Whether the right channel for an event with this header is known.
  [[nodiscard]] bool is_settled(const events::EventHeader& header,
                                const events::EventDescriptor* type) const;
  [[nodiscard]] bool lacks_name(const events::EventHeader& header) const;
  void hold(const events::EventView& event, MonotonicTime received, MonotonicTime origin);
  /// Records the held events of a type and source.
  void let_go(const Key& key, const events::EventDescriptor* type);
  void let_go_if(KnownTypes types, bool is_end);
  void put(const events::EventHeader& header, ConstBytes payload, MonotonicTime received,
           MonotonicTime origin, const events::EventDescriptor* type);
  /// Records what viewers draw of a sample, or keeps the models that they draw.
  void put_view(const events::EventHeader& header, ConstBytes payload,
                const recording::Message& recorded);
  /// Finds or adds the channel of an event; null if the file has no channel left.
  ChannelOfEvents* channel_of(const events::EventHeader& header,
                              const events::EventDescriptor* type);
  expected<std::uint16_t, SetupError> add_channel(const events::EventHeader& header,
                                                  const events::EventDescriptor* type,
                                                  const schema::Dynamic* dynamic,
                                                  const std::string* device);
  /// The name of the source device; null if the source is not a device, or has no name.
  const std::string* device_of(const events::EventHeader& header);

  mutable rt::PiMutex mutex_{};
  bool names_devices_;
  std::map<Key, std::vector<Held>> held_{};
  std::size_t held_byte_count_ = 0;
  recording::Recorder& recorder_;
  recording::Recorder::Track& track_;
  ViewRecorder views_;
  EventSchemas schemas_{};
  std::map<Key, ChannelOfEvents> channels_{};
  std::map<events::SourceId, std::string> devices_{};
  std::set<events::SourceId> seen_devices_{};
  std::set<events::SourceId> seen_unnamed_{};
  std::vector<std::string> new_devices_{};
  bool has_new_unnamed_ = false;
};

}  // namespace rtpm::capture
