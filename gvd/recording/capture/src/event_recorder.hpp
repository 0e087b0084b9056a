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

namespace rtpm::capture {

/// The descriptors that are known, as events::HubTypes::list() has them.
using KnownTypes = std::span<const events::EventDescriptor* const>;

/// Records events, each type and source in a channel of its own, with its schema: topic
/// "lab.Touched/3", or "lab/arm0/sampled" for a device whose name is known. The payload is a
/// FlatBuffer whose root is the event's table. Sequence and origin are the message's sequence and
/// publish time; the log time is the time of arrival.
///
/// The first events of a program may come before its types and names are known here. They are held
/// back, at most kHoldTimeMax and kHeldByteMax in all, so that they get into the right channel.
/// @ownership refers to its recorder, which other sources may share
/// @threads  record() on one, the rest on any; allocates and waits, so none of real time
class EventRecorder {
 public:
  static constexpr Duration kHoldTimeMax = std::chrono::seconds{3};
  /// The size that a track takes at once, so that no held event is dropped when it is recorded.
  static constexpr std::size_t kHeldByteMax = 2 << 20;

  /// Takes a track of its own.
  /// @param names_devices  whether name_devices() will be called, so that events wait for it
  explicit EventRecorder(recording::Recorder& recorder, bool names_devices = false);
  EventRecorder(const EventRecorder&) = delete;
  EventRecorder& operator=(const EventRecorder&) = delete;
  ~EventRecorder() = default;

  /// Records one event; the recorder counts it as dropped if it can't take it.
  /// @param type  null while the type is not known
  void record(const events::EventView& event, const events::EventDescriptor* type);
  /// Records held events whose type and name are known by now, or that waited for too long.
  /// Call it now and then.
  void attend(KnownTypes types);
  /// Records all held events. Call it before the recorder is closed.
  void finish(KnownTypes types);
  /// Whether events are held back, so that the caller should ask for types and names.
  [[nodiscard]] bool is_holding() const;

  /// Names the channels of these devices. Earlier events of theirs stay in channels by number.
  void name_devices(std::span<const std::string> names);
  /// The named devices whose first event came since the last call.
  [[nodiscard]] std::vector<std::string> take_new_devices();
  /// Whether device names are missing: events wait for one, or the first event of a device without
  /// a name came since the last call.
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
  };
  /// Whether the right channel of such an event is known.
  [[nodiscard]] bool is_settled(const events::EventHeader& header,
                                const events::EventDescriptor* type) const;
  [[nodiscard]] bool lacks_name(const events::EventHeader& header) const;
  void hold(const events::EventView& event, MonotonicTime now);
  /// Records the held events of a type and source.
  void let_go(const Key& key, const events::EventDescriptor* type);
  void let_go_if(KnownTypes types, bool is_end);
  void put(const events::EventHeader& header, ConstBytes payload, MonotonicTime received,
           const events::EventDescriptor* type);
  /// Finds or adds the channel of an event; null if the file takes no more channels.
  ChannelOfEvents* channel_of(const events::EventHeader& header,
                              const events::EventDescriptor* type);
  expected<std::uint16_t, SetupError> add_channel(const events::EventHeader& header,
                                                  const events::EventDescriptor* type,
                                                  const schema::Dynamic* dynamic,
                                                  const std::string* device);
  /// The name of the device that is the source; null if it is not a device, or has no name.
  const std::string* device_of(const events::EventHeader& header);

  mutable rt::PiMutex mutex_{};
  bool names_devices_;
  std::map<Key, std::vector<Held>> held_{};
  std::size_t held_byte_count_ = 0;
  recording::Recorder& recorder_;
  recording::Recorder::Track& track_;
  EventSchemas schemas_{};
  std::map<Key, ChannelOfEvents> channels_{};
  std::map<events::SourceId, std::string> devices_{};
  std::set<events::SourceId> seen_devices_{};
  std::set<events::SourceId> seen_unnamed_{};
  std::vector<std::string> new_devices_{};
  bool has_new_unnamed_ = false;
};

}  // namespace rtpm::capture
