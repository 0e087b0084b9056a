#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "rtpm/base/bytes.hpp"

/// Recordings: files in the MCAP format, which Foxglove and other tools read.
/// @source   https://mcap.dev/spec
namespace rtpm::recording {

/// How chunks are compressed.
enum class Compression : std::uint8_t { kNone, kLz4, kZstd };

/// Describes the payloads of a channel.
/// @ownership a value
struct Schema {
  std::string name;      ///< "lab.Touched".
  std::string encoding;  ///< "flatbuffer" of a reflection.Schema, "jsonschema"; empty if none.
  std::vector<std::byte> data;  ///< In that encoding.
  friend bool operator==(const Schema&, const Schema&) = default;
};

/// One sequence of messages.
/// @ownership a value
struct Channel {
  std::uint16_t schema_id = 0;  ///< 0 if none.
  std::string topic;
  std::string message_encoding;  ///< "flatbuffer", "json".
  std::map<std::string, std::string> metadata{};
  friend bool operator==(const Channel&, const Channel&) = default;
};

/// One recorded message.
/// @ownership views its bytes
struct Message {
  std::uint16_t channel_id = 0;
  std::uint32_t sequence = 0;         ///< The sender's count; 0 if it has none.
  std::uint64_t log_time_ns = 0;      ///< When it was recorded, since 1970 in UTC.
  std::uint64_t publish_time_ns = 0;  ///< When it was sent; the log time if unknown.
  ConstBytes data{};
};

/// A named set of texts about the whole recording.
/// @ownership a value
struct Metadata {
  std::string name;
  std::map<std::string, std::string> values{};
  friend bool operator==(const Metadata&, const Metadata&) = default;
};

/// A file inside the recording, such as a configuration.
/// @ownership a value
struct Attachment {
  std::string name;
  std::string media_type;  ///< "text/plain".
  std::uint64_t log_time_ns = 0;
  std::uint64_t create_time_ns = 0;  ///< 0 if unknown.
  std::vector<std::byte> data;
  friend bool operator==(const Attachment&, const Attachment&) = default;
};

/// A recording's counts and times.
/// @ownership a value
struct Statistics {
  std::uint64_t message_count = 0;
  std::uint32_t chunk_count = 0;
  std::uint64_t begin_ns = 0;  ///< Log time of the first message; 0 if there is none.
  std::uint64_t end_ns = 0;    ///< Log time of the last message.
  std::map<std::uint16_t, std::uint64_t> message_counts{};  ///< Keyed by channel.
};

}  // namespace rtpm::recording
