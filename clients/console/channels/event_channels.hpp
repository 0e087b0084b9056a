#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "channels/channel_table.hpp"
#include "live/callbacks.hpp"
#include "rtpm/capture/event_schemas.hpp"
#include "rtpm/driver/descriptor.hpp"
#include "rtpm/events/hub_types.hpp"
#include "rtpm/viewers/device_view.hpp"

namespace rtpm::console {

/// Limits for channels of event types that no device sends, and for the bytes of their advertised
/// schemas.
inline constexpr std::size_t kEventChannelCountMax = 128;
inline constexpr std::size_t kEventSchemaByteMax = std::size_t{8} << 20;

/// The event's time on this host's clock, in nanoseconds since 1970, as the hub may be on another
/// host.
[[nodiscard]] std::uint64_t log_time_ns(const HubEvent& event);

/// Publishes the hub's events as channel messages. A channel of a type that no device sends exists
/// from its first event until a minute after its last.
/// @ownership refers to the channels
/// @threads  the web server's thread
class EventChannels {
 public:
  explicit EventChannels(ChannelTable& channels) noexcept : channels_(channels) {}

  void set_devices(const std::set<std::string>& names);
  void set_types(std::shared_ptr<const events::HubTypes> types);
  /// Adds the channels that viewers draw of a device, from its samples.
  void set_descriptor(const std::string& name,
                      std::shared_ptr<const driver::Descriptor> descriptor);
  /// Sends the event to the subscribers of its channel.
  void publish(const HubEvent& event);
  /// Sends an event of a log filter to the filter's connection.
  void publish_log(const HubEvent& event);
  /// Removes channels without events. Call it about once a second.
  void drop_idle(MonotonicTime now);
  /// These limits and their use as JSON, for the page.
  [[nodiscard]] nlohmann::ordered_json state() const;
  /// The device with this source; nullptr if there is none.
  [[nodiscard]] const std::string* device_of(events::SourceId source) const;

 private:
  [[nodiscard]] const events::EventDescriptor* type_of(events::EventType type) const;
  /// @return whether the channel exists
  bool advertise(const std::string& topic, events::EventType type);
  void publish_generic(const HubEvent& event);
  void publish_sample(const std::string& device, const HubEvent& event);
  void publish_table(const std::string& topic, const HubEvent& event, std::uint64_t time_ns);
  /// Removes the channels that a device does not share.
  void remove_views(const std::string& device);
  void publish_views(const std::string& device, const HubEvent& event, std::uint64_t time_ns);
  /// Keeps the models that the device renders, for its next scenes.
  void set_models(const std::string& device, const HubEvent& event);
  void publish_change(const std::string& device, const HubEvent& event);
  [[nodiscard]] nlohmann::ordered_json payload_json(const HubEvent& event);

  struct Drawn {
    std::shared_ptr<const driver::Descriptor> descriptor{};
    viewers::DeviceView view;
  };

  ChannelTable& channels_;
  std::map<events::SourceId, std::string> devices_{};
  std::map<std::string, Drawn> drawn_{};  ///< Keyed by device.
  std::shared_ptr<const events::HubTypes> types_{};
  capture::EventSchemas schemas_{};
  std::map<std::string, std::uint64_t> advertised_{};  ///< Maps topics to schema ids.
  /// A channel for an event type that no device sends.
  struct Generic {
    MonotonicTime last{};  ///< When its newest event arrived.
    std::size_t schema_byte_count = 0;
  };
  std::map<std::string, Generic> generic_{};  ///< Keyed by topic.
  std::size_t schema_byte_count_ = 0;
  std::uint64_t omitted_count_ = 0;  ///< Events without a channel because of the limits.
};

}  // namespace rtpm::console
