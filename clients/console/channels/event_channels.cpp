#include "channels/event_channels.hpp"

#include <algorithm>
#include <cstring>
#include <device_events.rtpm.events.hpp>
#include <utility>

#include "foxglove/base64.hpp"
#include "foxglove/strict_json.hpp"
#include "rtpm/base/nesting.hpp"
#include "rtpm/gvd/device_event.hpp"
#include "rtpm/gvd/models_wire.hpp"
#include "rtpm/gvd/wire.hpp"
#include "rtpm/rt/utc.hpp"

namespace rtpm::console {
namespace {

using Json = nlohmann::ordered_json;

constexpr Duration kIdleTime = std::chrono::minutes{1};

}  // namespace

std::uint64_t log_time_ns(const HubEvent& event) {
  return rt::utc_ns(event.arrived - (event.header.hub_sent - event.header.origin));
}

void EventChannels::set_devices(const std::set<std::string>& names) {
  for (const auto& [source, name] : devices_) {
    if (names.contains(name)) continue;
    for (const std::string& topic : {name + "/sample", name + "/event"}) {
      channels_.remove(topic);
      advertised_.erase(topic);
    }
    remove_views(name);
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

void EventChannels::set_descriptor(const std::string& name,
                                   std::shared_ptr<const driver::Descriptor> descriptor) {
  const auto known = drawn_.find(name);
  const bool is_same = known != drawn_.end() && known->second.descriptor == descriptor;
  if (is_same || !devices_.contains(gvd::source_of(name))) return;
  remove_views(name);
  viewers::DeviceView view(name, *descriptor);
  for (const viewers::Channel& channel : view.channels()) {
    const viewers::Schema schema = viewers::schema_of(channel.type);
    channels_.add({.topic = channel.topic,
                   .encoding = "flatbuffer",
                   .schema_name = std::string(schema.name),
                   .schema = foxglove::to_base64(schema.reflection),
                   .schema_encoding = "flatbuffer"});
  }
  drawn_.insert_or_assign(name, Drawn{std::move(descriptor), std::move(view)});
}

void EventChannels::remove_views(const std::string& device) {
  const auto found = drawn_.find(device);
  if (found == drawn_.end()) return;
  for (const viewers::Channel& channel : found->second.view.channels()) {
    if (channel.topic != viewers::kTransformTopic) channels_.remove(channel.topic);
  }
  drawn_.erase(found);
}

void EventChannels::publish_views(const std::string& device, const HubEvent& event,
                                  std::uint64_t time_ns) {
  const auto found = drawn_.find(device);
  device::Sample wire;
  if (found == drawn_.end() || event.payload.size() != sizeof wire ||
      event.header.schema_id != device::SampledEvent::kSchemaId) {
    return;
  }
  viewers::DeviceView& view = found->second.view;
  const bool is_wanted = std::ranges::any_of(view.channels(), [&](const auto& channel) {
    return channels_.has_subscriber(channels_.find(channel.topic));
  });
  if (!is_wanted) return;
  std::memcpy(&wire, event.payload.data(), sizeof wire);
  for (const auto& due : view.take(gvd::from_wire(wire), time_ns)) {
    channels_.publish(channels_.find(view.channels()[due.channel].topic), time_ns,
                      {reinterpret_cast<const char*>(due.message.data()), due.message.size()});
  }
}

void EventChannels::set_models(const std::string& device, const HubEvent& event) {
  const auto found = drawn_.find(device);
  if (found == drawn_.end()) return;
  if (const auto models = gvd::models_of(event.header.schema_id, event.payload)) {
    found->second.view.set_models(*models, log_time_ns(event));
  }
}

const std::string* EventChannels::device_of(events::SourceId source) const {
  const auto found = devices_.find(source);
  return found == devices_.end() ? nullptr : &found->second;
}

const events::EventDescriptor* EventChannels::type_of(events::EventType type) const {
  return types_ ? types_->find(type) : nullptr;
}

bool EventChannels::advertise(const std::string& topic, events::EventType type) {
  const events::EventDescriptor* const known = type_of(type);
  if (known == nullptr) return false;
  const auto advertised = advertised_.find(topic);
  if (advertised != advertised_.end() && advertised->second == known->schema_id) return true;
  schema::Dynamic* const dynamic = schemas_.find(known);
  if (dynamic == nullptr) return false;
  advertised_[topic] = known->schema_id;
  channels_.add({.topic = topic,
                 .encoding = "flatbuffer",
                 .schema_name = std::string(known->name),
                 .schema = foxglove::to_base64(dynamic->flat_reflection(known->name)),
                 .schema_encoding = "flatbuffer"});
  return true;
}

void EventChannels::publish_generic(const HubEvent& event) {
  const events::EventDescriptor* const type = type_of(event.header.type);
  if (type == nullptr) return;
  const std::string topic =
      capture::type_text(event.header.type, type) + "/" + std::to_string(event.header.source);
  const auto known = generic_.find(topic);
  if (known != generic_.end()) {
    known->second.last = event.arrived;
    advertise(topic, event.header.type);
  } else {
    // The schema's reflection has about the size of its text; base64 adds a third.
    const std::size_t size = type->schema.size() * 4 / 3;
    if (generic_.size() >= kEventChannelCountMax ||
        schema_byte_count_ + size > kEventSchemaByteMax) {
      ++omitted_count_;
      return;
    }
    if (!advertise(topic, event.header.type)) return;
    generic_[topic] = {event.arrived, size};
    schema_byte_count_ += size;
  }
  publish_table(topic, event, log_time_ns(event));
}

void EventChannels::drop_idle(MonotonicTime now) {
  std::erase_if(generic_, [&](const auto& one) {
    const auto& [topic, channel] = one;
    if (now - channel.last < kIdleTime) return false;
    schema_byte_count_ -= channel.schema_byte_count;
    channels_.remove(topic);
    advertised_.erase(topic);
    return true;
  });
}

Json EventChannels::state() const {
  return {{"channel_count", generic_.size()},
          {"channel_count_max", kEventChannelCountMax},
          {"omitted_count", omitted_count_}};
}

void EventChannels::publish(const HubEvent& event) {
  const std::string* const device = device_of(event.header.source);
  switch (event.stream) {
    case EventStream::kSample:
      if (device == nullptr) break;
      publish_sample(*device, event);
      break;
    case EventStream::kChange:
      if (device == nullptr) break;
      if (event.header.type == gvd::kModelsRendered) set_models(*device, event);
      if (!event.header.is_replayed) publish_change(*device, event);
      break;
    case EventStream::kGeneric:
      publish_generic(event);
      break;
    case EventStream::kMark:
    case EventStream::kLog:
      break;
  }
}

void EventChannels::publish_sample(const std::string& device, const HubEvent& event) {
  // One time for all: each conversion to UTC reads the clocks again.
  const std::uint64_t time_ns = log_time_ns(event);
  publish_table(device + "/sample", event, time_ns);
  publish_views(device, event, time_ns);
}

void EventChannels::publish_table(const std::string& topic, const HubEvent& event,
                                  std::uint64_t time_ns) {
  const std::uint32_t channel = channels_.find(topic);
  if (channel == 0 || !channels_.has_subscriber(channel)) return;
  schema::Dynamic* const dynamic = schemas_.find(type_of(event.header.type));
  if (dynamic == nullptr) return;
  const auto table = dynamic->as_table(dynamic->event(), event.payload);
  if (!table) return;
  channels_.publish(channel, time_ns,
                    {reinterpret_cast<const char*>(table->data()), table->size()});
}

Json EventChannels::payload_json(const HubEvent& event) {
  if (schema::Dynamic* const dynamic = schemas_.find(type_of(event.header.type))) {
    if (const auto text = dynamic->decode(dynamic->event(), event.payload)) {
      Json json = parse_bounded_json<Json>(foxglove::strict_json(*text));
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
  channels_.publish(channel, log_time_ns(event), foxglove::dumped(json));
}

void EventChannels::publish_log(const HubEvent& event) {
  const std::uint32_t channel = channels_.find("console/log");
  if (event.omitted_count > 0) {
    channels_.publish_to(event.connection_id, channel, log_time_ns(event),
                         foxglove::dumped({{"omitted", event.omitted_count}}));
  }
  Json json{{"time_ns", log_time_ns(event)},
            {"type", capture::type_text(event.header.type, type_of(event.header.type))},
            {"source", event.header.source}};
  if (const std::string* const device = device_of(event.header.source)) json["device"] = *device;
  json["sequence"] = event.header.sequence;
  json["payload"] = payload_json(event);
  channels_.publish_to(event.connection_id, channel, log_time_ns(event), foxglove::dumped(json));
}

}  // namespace rtpm::console
