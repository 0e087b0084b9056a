#include "rtpm/capture/event_recorder.hpp"

#include <vector>

#include "rtpm/rt/clock.hpp"

namespace rtpm::capture {

EventRecorder::EventRecorder(recording::Recorder& recorder)
    : recorder_(recorder), track_(recorder.add_track()) {}

void EventRecorder::record(const events::EventView& event, const events::EventDescriptor* type) {
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

EventRecorder::ChannelOfEvents* EventRecorder::channel_of(const events::EventHeader& header,
                                                          const events::EventDescriptor* type) {
  const auto known = channels_.find({header.type, header.source});
  // The schema may become known later: then the source goes on in a channel that has it.
  const bool has_schema = type != nullptr && !type->schema.empty();
  if (known != channels_.end() && (known->second.dynamic != nullptr || !has_schema)) {
    return &known->second;
  }
  schema::Dynamic* const dynamic = schemas_.find(type);
  if (known != channels_.end() && dynamic == nullptr) return &known->second;
  const auto number = add_channel(header, type, dynamic);
  if (!number) return nullptr;
  ChannelOfEvents& channel = channels_[{header.type, header.source}];
  channel = {*number, dynamic};
  return &channel;
}

std::optional<std::uint16_t> EventRecorder::add_channel(const events::EventHeader& header,
                                                        const events::EventDescriptor* type,
                                                        const schema::Dynamic* dynamic) {
  recording::Channel channel;
  channel.topic = type_text(header.type, type) + "/" + std::to_string(header.source);
  channel.metadata = {{"rtpm.kind", "event"},
                      {"rtpm.type", std::to_string(header.type)},
                      {"rtpm.source", std::to_string(header.source)},
                      {"rtpm.schema_id", std::to_string(header.schema_id)},
                      {"rtpm.priority", std::to_string(header.priority.value())}};
  if (dynamic != nullptr) {
    const auto bytes = dynamic->reflection();
    const auto schema = recorder_.add_schema({.name = std::string(type->name),
                                              .encoding = "flatbuffer",
                                              .data = {bytes.begin(), bytes.end()}});
    if (!schema) return std::nullopt;
    channel.schema_id = *schema;
    channel.message_encoding = "flatbuffer";
  }
  const auto number = recorder_.add_channel(channel);
  return number ? std::optional(*number) : std::nullopt;
}

}  // namespace rtpm::capture
