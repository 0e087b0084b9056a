#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <utility>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/schema/dynamic.hpp"

namespace rtpm::capture {

/// Adds a schema that viewers read, and a channel for tables of it.
/// @param file  a recording::Recorder or FileWriter
/// @param type  the tables' name, "rtpm.device.Description"
/// @errors   the file has no schema or channel left
template <class File>
[[nodiscard]] expected<std::uint16_t, SetupError> add_flatbuffer_channel(
    File& file, const schema::Dynamic& dynamic, std::string type, std::string topic,
    std::map<std::string, std::string> metadata) {
  auto bytes = dynamic.flat_reflection(type);
  const auto schema = file.add_schema(
      {.name = std::move(type), .encoding = "flatbuffer", .data = std::move(bytes)});
  if (!schema) return schema;
  return file.add_channel({.schema_id = *schema,
                           .topic = std::move(topic),
                           .message_encoding = "flatbuffer",
                           .metadata = std::move(metadata)});
}

}  // namespace rtpm::capture
