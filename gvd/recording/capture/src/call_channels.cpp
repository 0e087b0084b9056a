#include "call_channels.hpp"

#include <introspection.rtpm.events.hpp>
#include <span>
#include <vector>

#include "rtpm/base/printable.hpp"
#include "rtpm/schema/dynamic.hpp"

namespace rtpm::capture {
namespace {

using introspection::TapStage;

ConstBytes finished(const flatbuffers::FlatBufferBuilder& builder) {
  return std::as_bytes(std::span(builder.GetBufferPointer(), builder.GetSize()));
}

std::vector<std::byte> empty_table() {
  flatbuffers::FlatBufferBuilder builder;
  const auto begin = builder.StartTable();
  builder.Finish(flatbuffers::Offset<flatbuffers::Table>(builder.EndTable(begin)));
  const ConstBytes bytes = finished(builder);
  return {bytes.begin(), bytes.end()};
}

}  // namespace

CallChannels::CallChannels(recording::Recorder& recorder, recording::Recorder::Track& track,
                           std::string path, std::unique_ptr<dynamic::RemoteObject> object) noexcept
    : recorder_(recorder), track_(track), path_(std::move(path)), object_(std::move(object)) {}

expected<std::unique_ptr<CallChannels>, SetupError> CallChannels::create(
    recording::Recorder& recorder, recording::Recorder::Track& track, std::string path,
    std::unique_ptr<dynamic::RemoteObject> object) {
  std::unique_ptr<CallChannels> channels(
      new CallChannels(recorder, track, std::move(path), std::move(object)));
  if (auto added = channels->add_record_channel(); !added) return unexpected{added.error()};
  return channels;
}

expected<void, SetupError> CallChannels::add_record_channel() {
  const events::EventDescriptor& type = introspection::CallRecordEvent::kDescriptor;
  std::string error;
  const auto dynamic = schema::Dynamic::make_for_event(std::string(type.schema), type.name, error);
  if (!dynamic) return setup_error("the schema of " + std::string(type.name), error);
  const auto bytes = dynamic->reflection();
  const auto schema = recorder_.add_schema({.name = std::string(type.name),
                                            .encoding = "flatbuffer",
                                            .data = {bytes.begin(), bytes.end()}});
  if (!schema) return unexpected{schema.error()};
  const auto number =
      recorder_.add_channel({.schema_id = *schema,
                             .topic = path_ + "/calls",
                             .message_encoding = "flatbuffer",
                             .metadata = {{"rtpm.kind", "calls"},
                                          {"rtpm.object", path_},
                                          {"rtpm.interface", object_->dynamic().service().name}}});
  if (!number) return unexpected{number.error()};
  record_channel_ = *number;
  return {};
}

const schema::Method* CallChannels::method_of(std::uint16_t id) const noexcept {
  for (const schema::Method& method : object_->dynamic().service().methods) {
    if (method.id == id) return &method;
  }
  return nullptr;
}

std::optional<std::uint16_t> CallChannels::channel_of(const schema::Method& method, Part part) {
  if (const auto known = channels_.find({method.id, part}); known != channels_.end()) {
    return known->second;
  }
  schema::Dynamic& dynamic = object_->dynamic();
  const schema::Payload& payload = part == Part::kRequest ? method.request : method.reply;
  const auto bytes = dynamic.reflection();
  const auto schema = recorder_.add_schema({.name = dynamic.model().objects[payload.table].name,
                                            .encoding = "flatbuffer",
                                            .data = {bytes.begin(), bytes.end()}});
  if (!schema) return std::nullopt;
  const char* const name = part == Part::kRequest ? "request" : "response";
  const auto number =
      recorder_.add_channel({.schema_id = *schema,
                             .topic = path_ + "/" + method.name + "/" + name,
                             .message_encoding = "flatbuffer",
                             .metadata = {{"rtpm.kind", "call"},
                                          {"rtpm.part", name},
                                          {"rtpm.object", path_},
                                          {"rtpm.interface", dynamic.service().name},
                                          {"rtpm.method", method.name},
                                          {"rtpm.method_id", std::to_string(method.id)}}});
  if (!number) return std::nullopt;
  channels_[{method.id, part}] = *number;
  return *number;
}

bool CallChannels::record_payload(const schema::Method& method, Part part, ConstBytes payload,
                                  recording::Message message) {
  const schema::Payload& type = part == Part::kRequest ? method.request : method.reply;
  const auto table = type.kind == schema::PayloadKind::kEmpty
                         ? std::optional(empty_table())
                         : object_->dynamic().as_table(type, payload);
  if (!table) return false;
  const auto channel = channel_of(method, part);
  if (!channel) return true;
  message.channel_id = *channel;
  message.data = *table;
  static_cast<void>(track_.put(message));
  return true;
}

int CallChannels::record(const introspection::TappedCall& call, ConstBytes request,
                         ConstBytes reply, const CallTimes& times) {
  const schema::Method* const method = method_of(call.method());
  const TapStage stage = call.stage();
  const bool is_end = stage == TapStage::Whole || stage == TapStage::Ended;
  int unreadable_count = 0;
  recording::Message message{.sequence = static_cast<std::uint32_t>(call.number()),
                             .log_time_ns = times.log_ns};
  if (method != nullptr && call.has_request() &&
      (stage == TapStage::Whole || stage == TapStage::Begun)) {
    message.publish_time_ns = times.received_ns;
    if (!record_payload(*method, Part::kRequest, request, message)) ++unreadable_count;
  }
  // The end of a stream has no content.
  const bool has_response = call.has_reply() && call.status() == introspection::CallStatus::ok &&
                            (stage == TapStage::Item || is_end) &&
                            !(method != nullptr && method->is_stream && is_end);
  if (method != nullptr && has_response) {
    message.publish_time_ns = times.finished_ns;
    if (!record_payload(*method, Part::kResponse, reply, message)) ++unreadable_count;
  }
  if (is_end) record_end(call, method, times);
  return unreadable_count;
}

void CallChannels::record_end(const introspection::TappedCall& call, const schema::Method* method,
                              const CallTimes& times) {
  builder_.Clear();
  const auto name = method == nullptr ? 0 : builder_.CreateString(method->name);
  builder_.Finish(introspection::CreateCallRecord(
      builder_, call.number(), name, call.method(), call.status(), call.priority(), call.session(),
      call.trace_id(), call.finished_ns() - call.received_ns(), call.request_size(),
      call.reply_size()));
  static_cast<void>(track_.put({.channel_id = record_channel_,
                                .sequence = static_cast<std::uint32_t>(call.number()),
                                .log_time_ns = times.log_ns,
                                .publish_time_ns = times.finished_ns,
                                .data = finished(builder_)}));
}

}  // namespace rtpm::capture
