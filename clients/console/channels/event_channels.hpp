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
#include "rtpm/events/hub_types.hpp"

namespace rtpm::console {

/// Events of the hub as messages of channels.
/// @ownership refers to the channels
/// @threads  the web server's
class EventChannels {
 public:
  explicit EventChannels(ChannelTable& channels) noexcept : channels_(channels) {}

  void set_devices(const std::set<std::string>& names);
  void set_types(std::shared_ptr<const events::HubTypes> types);
  /// Sends the event to the subscribers of its channel.
  void publish(const HubEvent& event);
  /// Sends an event of a log filter to its connection.
  void publish_log(const HubEvent& event);
  /// nullptr: no device has this source.
  [[nodiscard]] const std::string* device_of(events::SourceId source) const;

 private:
  [[nodiscard]] const events::EventDescriptor* type_of(events::EventType type) const;
  void advertise(const std::string& topic, events::EventType type);
  void publish_table(const std::string& topic, const HubEvent& event);
  void publish_change(const std::string& device, const HubEvent& event);
  [[nodiscard]] nlohmann::ordered_json payload_json(const HubEvent& event);

  ChannelTable& channels_;
  std::map<events::SourceId, std::string> devices_{};
  std::shared_ptr<const events::HubTypes> types_{};
  capture::EventSchemas schemas_{};
  std::map<std::string, std::uint64_t> advertised_{};  ///< Topic to schema id.
};

}  // namespace rtpm::console
