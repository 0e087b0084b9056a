#include "rtpm/capture/event_recorder.hpp"

#include <mutex>

#include "rtpm/capture/channels.hpp"
#include "rtpm/gvd/device_event.hpp"
#include "rtpm/rt/clock.hpp"

namespace rtpm::capture {

EventRecorder::EventRecorder(recording::Recorder& recorder)
    : recorder_(recorder), track_(recorder.add_track()) {}

void EventRecorder::record(const events::EventView& event, const events::EventDescriptor* type) {
  const std::lock_guard lock(mutex_);
  const events::EventHeader& header = event.header;
  const ChannelOfEvents* const channel = channel_of(header, type);
  if (channel == nullptr) return;
  const MonotonicTime now = rt::now();
  recording::Message message{
      .channel_id = channel->number,
      .sequence = static_cast<std::uint32_t>(header.sequence),
      .log_time_ns = recorder_.log_time_ns(now),
      // The hub's clock may be another's, so only its difference counts.
      .publish_time_ns = recorder_.log_time_ns(now - (header.hub_sent - header.origin)),
      .data = event.payload};
  std::optional<std::vector<std::byte>> table;
  if (channel->dynamic != nullptr) {
    table = channel->dynamic->as_table(channel->dynamic->event(), event.payload);
    if (table) message.data = *table;
  }
  static_cast<void>(track_.put(message));
}

void EventRecorder::name_devices(std::span<const std::string> names) {
  const std::lock_guard lock(mutex_);
  for (const std::string& name : names)
    devices_.insert_or_assign(gvd::source_of(name), name);
}

std::vector<std::string> EventRecorder::take_new_devices() {
  const std::lock_guard lock(mutex_);
  return std::exchange(new_devices_, {});
}

bool EventRecorder::take_new_unnamed() {
  const std::lock_guard lock(mutex_);
  return std::exchange(has_new_unnamed_, false);
}

const std::string* EventRecorder::device_of(const events::EventHeader& header) {
  if (!is_device_event(header.type)) return nullptr;
  const auto known = devices_.find(header.source);
  if (known == devices_.end()) {
    if (seen_unnamed_.insert(header.source).second) has_new_unnamed_ = true;
    return nullptr;
  }
  if (seen_devices_.insert(header.source).second) new_devices_.push_back(known->second);
  return &known->second;
}

EventRecorder::ChannelOfEvents* EventRecorder::channel_of(const events::EventHeader& header,
                                                          const events::EventDescriptor* type) {
  const auto known = channels_.find({header.type, header.source});
  const std::string* const device = device_of(header);
  // Schema and name may become known later: then the source goes on in a channel that has them.
  const bool has_schema = type != nullptr && !type->schema.empty();
  const bool is_known = known != channels_.end();
  const bool keeps_name = is_known && known->second.is_named == (device != nullptr);
  if (keeps_name && (known->second.dynamic != nullptr || !has_schema)) return &known->second;
  schema::Dynamic* const dynamic = schemas_.find(type);
  if (keeps_name && dynamic == nullptr) return &known->second;
  const auto number = add_channel(header, type, dynamic, device);
  if (!number) return nullptr;
  ChannelOfEvents& channel = channels_[{header.type, header.source}];
  channel = {*number, dynamic, device != nullptr};
  return &channel;
}

std::optional<std::uint16_t> EventRecorder::add_channel(const events::EventHeader& header,
                                                        const events::EventDescriptor* type,
                                                        const schema::Dynamic* dynamic,
                                                        const std::string* device) {
  recording::Channel channel;
  const std::string name = type_text(header.type, type);
  channel.topic = device != nullptr && type != nullptr ? device_topic(*device, name)
                                                       : name + "/" + std::to_string(header.source);
  channel.metadata = {{kKindKey, kEventKind},
                      {kTypeKey, std::to_string(header.type)},
                      {kSourceKey, std::to_string(header.source)},
                      {kSchemaIdKey, std::to_string(header.schema_id)},
                      {kPriorityKey, std::to_string(header.priority.value())}};
  if (type != nullptr) channel.metadata[kNameKey] = name;
  if (device != nullptr) channel.metadata[kDeviceKey] = *device;
  if (dynamic != nullptr) {
    const auto bytes = dynamic->reflection();
    const auto schema = recorder_.add_schema({.name = std::string(type->name),
                                              .encoding = "flatbuffer",
                                              .data = {bytes.begin(), bytes.end()}});
    if (!schema) return std::nullopt;
    channel.schema_id = *schema;
    channel.message_encoding = "flatbuffer";
    if (const auto struct_index = dynamic->event().struct_index) {
      channel.metadata[kStructSizeKey] =
          std::to_string(dynamic->model().objects[*struct_index].byte_size);
    }
  }
  const auto number = recorder_.add_channel(channel);
  return number ? std::optional(*number) : std::nullopt;
}

}  // namespace rtpm::capture
