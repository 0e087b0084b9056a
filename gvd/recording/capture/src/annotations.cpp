#include "rtpm/capture/annotations.hpp"

#include <mutex>
#include <span>

#include "rtpm/rt/clock.hpp"

namespace rtpm::capture {
namespace {

constexpr std::string_view kSchema =
    R"({"type": "object", "properties": {"text": {"type": "string"}}})";

/// The text as a JSON string. Bytes above ASCII stay as they are.
std::string quoted(std::string_view text) {
  std::string json = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') {
      json += '\\';
      json += c;
    } else if (static_cast<unsigned char>(c) < 0x20) {
      constexpr std::string_view kDigits = "0123456789abcdef";
      json += "\\u00";
      json += kDigits[static_cast<unsigned char>(c) >> 4];
      json += kDigits[static_cast<unsigned char>(c) & 15];
    } else {
      json += c;
    }
  }
  return json + "\"";
}

}  // namespace

expected<std::unique_ptr<Annotations>, SetupError> Annotations::create(
    recording::Recorder& recorder) {
  const auto bytes = std::as_bytes(std::span(kSchema));
  const auto schema = recorder.add_schema(
      {.name = "rtpm.Annotation", .encoding = "jsonschema", .data = {bytes.begin(), bytes.end()}});
  if (!schema) return unexpected{schema.error()};
  const auto channel = recorder.add_channel(
      {.schema_id = *schema, .topic = kAnnotationTopic, .message_encoding = "json"});
  if (!channel) return unexpected{channel.error()};
  return std::unique_ptr<Annotations>(new Annotations(recorder, *channel));
}

bool Annotations::annotate(std::string_view text) {
  const std::string json = "{\"text\": " + quoted(text) + "}";
  const std::lock_guard lock(mutex_);
  const std::uint64_t time_ns = recorder_.log_time_ns(rt::now());
  return track_.put({.channel_id = channel_,
                     .sequence = ++sequence_,
                     .log_time_ns = time_ns,
                     .publish_time_ns = time_ns,
                     .data = std::as_bytes(std::span(json))});
}

}  // namespace rtpm::capture
