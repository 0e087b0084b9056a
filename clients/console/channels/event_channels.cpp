#include "channels/event_channels.hpp"

#include <utility>

#include "foxglove/base64.hpp"
#include "foxglove/strict_json.hpp"
#include "rtpm/gvd/device_event.hpp"
#include "work/wall_time.hpp"

namespace rtpm::console {
namespace {

using Json = nlohmann::ordered_json;

/// When it happened, by this host's clock: the hub's may be another's.
std::uint64_t log_time_ns(const HubEvent& event) {
  return wall_time_ns(event.arrived - (event.header.hub_sent - event.header.origin));
}

std::string dumped(const Json& json) {
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

}  // namespace

void EventChannels::set_devices(const std::set<std::string>& names) {
  for (const auto& [source, name] : devices_) {
    if (names.contains(name)) continue;
    for (const std::string& topic : {name + "/sample", name + "/event"}) {
      channels_.remove(topic);
      advertised_.erase(topic);
    }
  }
  devices_.clear();
  for (const std::string& name : names) {
    devices_[gvd::source_of(name)] = name;
    channels_.add({.topic = name + "/event", .encoding = "json"});
    advertise(name + "/sample", gvd::kSampled);
  }
}

void EventChannels::set_types(std::shared_ptr<const events::HubTypes> types) {
  types_ = std::move(types);
  for (const auto& [source, name] : devices_)
    advertise(name + "/sample", gvd::kSampled);
}

const std::string* EventChannels::device_of(events::SourceId source) const {
  const auto found = devices_.find(source);
  return found == devices_.end() ? nullptr : &found->second;
}

const events::EventDescriptor* EventChannels::type_of(events::EventType type) const {
  return types_ ? types_->find(type) : nullptr;
}

void EventChannels::advertise(const std::string& topic, events::EventType type) {
  const events::EventDescriptor* const known = type_of(type);
  if (known == nullptr) return;
  const auto advertised = advertised_.find(topic);
  if (advertised != advertised_.end() && advertised->second == known->schema_id) return;
  schema::Dynamic* const dynamic = schemas_.find(known);
  if (dynamic == nullptr) return;
  advertised_[topic] = known->schema_id;
  channels_.add({.topic = topic,
                 .encoding = "flatbuffer",
                 .schema_name = std::string(known->name),
                 .schema = foxglove::to_base64(dynamic->reflection()),
                 .schema_encoding = "flatbuffer"});
}

void EventChannels::publish(const HubEvent& event) {
  const std::string* const device = device_of(event.header.source);
  switch (event.stream) {
    case EventStream::kSample:
      if (device != nullptr) publish_table(*device + "/sample", event);
      break;
    case EventStream::kChange:
      if (device != nullptr && !event.header.is_replayed) publish_change(*device, event);
      break;
    case EventStream::kGeneric: {
      const events::EventDescriptor* const type = type_of(event.header.type);
      if (type == nullptr) break;
      const std::string topic =
          capture::type_text(event.header.type, type) + "/" + std::to_string(event.header.source);
      advertise(topic, event.header.type);
      publish_table(topic, event);
      break;
    }
    case EventStream::kLog:
      break;
  }
}

void EventChannels::publish_table(const std::string& topic, const HubEvent& event) {
  const std::uint32_t channel = channels_.find(topic);
  if (channel == 0 || !channels_.has_subscriber(channel)) return;
  schema::Dynamic* const dynamic = schemas_.find(type_of(event.header.type));
  if (dynamic == nullptr) return;
  const auto table = dynamic->as_table(dynamic->event(), event.payload);
  if (!table) return;
  channels_.publish(channel, log_time_ns(event),
                    {reinterpret_cast<const char*>(table->data()), table->size()});
}

Json EventChannels::payload_json(const HubEvent& event) {
  if (schema::Dynamic* const dynamic = schemas_.find(type_of(event.header.type))) {
    if (const auto text = dynamic->decode(dynamic->event(), event.payload)) {
      Json json = Json::parse(foxglove::strict_json(*text), nullptr, false);
      if (!json.is_discarded()) return json;
    }
  }
  return {};
}

void EventChannels::publish_change(const std::string& device, const HubEvent& event) {
  const std::uint32_t channel = channels_.find(device + "/event");
  if (channel == 0 || !channels_.has_subscriber(channel)) return;
  const Json json{{"type", capture::type_text(event.header.type, type_of(event.header.type))},
                  {"device", device},
                  {"origin_ns", log_time_ns(event)},
                  {"sequence", event.header.sequence},
                  {"payload", payload_json(event)}};
  channels_.publish(channel, log_time_ns(event), dumped(json));
}

void EventChannels::publish_log(const HubEvent& event) {
  const std::uint32_t channel = channels_.find("console/log");
  if (event.omitted_count > 0) {
    channels_.publish_to(event.connection_id, channel, log_time_ns(event),
                         dumped({{"omitted", event.omitted_count}}));
  }
  Json json{{"time_ns", log_time_ns(event)},
            {"type", capture::type_text(event.header.type, type_of(event.header.type))},
            {"source", event.header.source}};
  if (const std::string* const device = device_of(event.header.source)) json["device"] = *device;
  json["sequence"] = event.header.sequence;
  json["payload"] = payload_json(event);
  channels_.publish_to(event.connection_id, channel, log_time_ns(event), dumped(json));
}

}  // namespace rtpm::console
