#pragma once

#include <zlib.h>

#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

/// Recordings as other writers make them, byte by byte and without this tree's writer. The format
/// leaves much to a writer: whether it uses chunks, indexes them, repeats channels in the summary …
namespace rtpm::recording::foreign {

template <class T>
std::string number(T value) {
  std::string bytes;
  for (std::size_t i = 0; i < sizeof value; ++i)
    bytes += static_cast<char>(static_cast<std::uint64_t>(value) >> (8 * i));
  return bytes;
}
inline std::string u16(std::uint64_t value) {
  return number(static_cast<std::uint16_t>(value));
}
inline std::string u32(std::uint64_t value) {
  return number(static_cast<std::uint32_t>(value));
}
inline std::string u64(std::uint64_t value) {
  return number(value);
}
inline std::string text(std::string_view value) {
  return u32(value.size()) + std::string(value);
}
inline std::string texts(const std::map<std::string, std::string>& values) {
  std::string entries;
  for (const auto& [key, value] : values)
    entries += text(key) + text(value);
  return text(entries);
}
inline std::string record(char opcode, const std::string& content) {
  return opcode + u64(content.size()) + content;
}
inline std::uint32_t crc(std::string_view bytes) {
  return static_cast<std::uint32_t>(
      ::crc32_z(0, reinterpret_cast<const Bytef*>(bytes.data()), bytes.size()));
}
inline const std::string kMagic("\x89MCAP0\r\n", 8);

inline std::string schema(std::uint64_t id, std::string_view name) {
  return record(3, u16(id) + text(name) + text("jsonschema") + text("{}"));
}
inline std::string channel(std::uint64_t id, std::uint64_t schema_id, std::string_view topic) {
  return record(4, u16(id) + u16(schema_id) + text(topic) + text("json") + texts({{"foo", "bar"}}));
}
inline std::string message(std::uint64_t channel_id, std::uint64_t sequence,
                           std::uint64_t log_time_ns, std::string_view data) {
  return record(
      5, u16(channel_id) + u32(sequence) + u64(log_time_ns) + u64(log_time_ns) + std::string(data));
}
/// @param size  the size that the chunk states for its uncompressed records
inline std::string chunk(std::uint64_t begin_ns, std::uint64_t end_ns, std::string_view compression,
                         const std::string& records, std::uint64_t size) {
  return record(6, u64(begin_ns) + u64(end_ns) + u64(size) + u32(0) + text(compression) +
                       u64(records.size()) + records);
}
inline std::string chunk(std::uint64_t begin_ns, std::uint64_t end_ns, const std::string& records) {
  return chunk(begin_ns, end_ns, "", records, records.size());
}
inline std::string chunk_index(std::uint64_t begin_ns, std::uint64_t end_ns, std::uint64_t offset,
                               std::uint64_t size,
                               const std::map<std::uint16_t, std::uint64_t>& index_offsets = {}) {
  std::string offsets;
  for (const auto& [id, at] : index_offsets)
    offsets += u16(id) + u64(at);
  return record(8, u64(begin_ns) + u64(end_ns) + u64(offset) + u64(size) + text(offsets) + u64(0) +
                       text("") + u64(size) + u64(size));
}
struct Counts {
  std::uint64_t messages = 0, schemas = 0, channels = 0, attachments = 0, metadata = 0, chunks = 0;
};
inline std::string statistics(const Counts& counts, std::uint64_t begin_ns, std::uint64_t end_ns,
                              const std::map<std::uint16_t, std::uint64_t>& by_channel) {
  std::string list;
  for (const auto& [id, count] : by_channel)
    list += u16(id) + u64(count);
  return record(11, u64(counts.messages) + u16(counts.schemas) + u32(counts.channels) +
                        u32(counts.attachments) + u32(counts.metadata) + u32(counts.chunks) +
                        u64(begin_ns) + u64(end_ns) + text(list));
}
/// A whole file: magic, header, `data`, its end, `summary`, footer, magic.
inline std::string header() {
  return kMagic + record(1, text("") + text(""));
}
inline std::string file(const std::string& data, const std::string& summary) {
  const std::string begin = header() + data + record(15, u32(0));
  const std::uint64_t summary_begin = summary.empty() ? 0 : begin.size();
  const std::string footer = '\x02' + u64(20) + u64(summary_begin) + u64(0);
  return begin + summary + footer + u32(crc(summary + footer)) + kMagic;
}

/// The features that the conformance set of the format combines.
enum Feature : unsigned {
  kChunks = 1,             ///< ch
  kChunkIndex = 2,         ///< chx
  kMessageIndex = 4,       ///< mx
  kRepeatedSchemas = 8,    ///< rsh
  kRepeatedChannels = 16,  ///< rch
  kStatistics = 32,        ///< st
  kSummaryOffsets = 64,    ///< sum
  kPadding = 128,          ///< pad: bytes behind the known fields of each record
  kAttachmentIndex = 256,  ///< ax
  kMetadataIndex = 512,    ///< mdx
};
inline constexpr unsigned kFeatureEnd = 1024;

/// The contents of a vector.
struct Content {
  const char* name;
  int message_count;
  bool has_schema;
  bool has_attachment;
  bool has_metadata;
};
inline const std::vector<Content> kContents{{"NoData", 0, false, false, false},
                                            {"OneMessage", 1, true, false, false},
                                            {"OneSchemalessMessage", 1, false, false, false},
                                            {"TenMessages", 10, true, false, false},
                                            {"OneAttachment", 0, false, true, false},
                                            {"OneMetadata", 0, false, false, true}};

/// Whether the set has such a vector: no feature without the records it applies to.
inline bool is_combined(const Content& content, unsigned features) {
  const bool has_messages = content.message_count > 0;
  if (!has_messages && (features & (kChunks | kRepeatedChannels)) != 0) return false;
  if (!content.has_schema && (features & kRepeatedSchemas) != 0) return false;
  if ((features & kChunks) == 0 && (features & (kChunkIndex | kMessageIndex)) != 0) return false;
  if (!content.has_attachment && (features & kAttachmentIndex) != 0) return false;
  return content.has_metadata || (features & kMetadataIndex) == 0;
}

/// The name of a vector, such as "OneMessage-ch-chx-mx-st".
inline std::string name_of(const Content& content, unsigned features) {
  std::string name = content.name;
  const std::vector<std::pair<Feature, const char*>> words{
      {kChunks, "-ch"},        {kChunkIndex, "-chx"},       {kMessageIndex, "-mx"},
      {kPadding, "-pad"},      {kRepeatedChannels, "-rch"}, {kRepeatedSchemas, "-rsh"},
      {kStatistics, "-st"},    {kSummaryOffsets, "-sum"},   {kAttachmentIndex, "-ax"},
      {kMetadataIndex, "-mdx"}};
  for (const auto& [feature, word] : words)
    name += (features & feature) != 0 ? word : "";
  return name;
}

/// Builds one vector.
class Vector {
 public:
  Vector(const Content& content, unsigned features) : content_(content), features_(features) {}

  [[nodiscard]] std::string bytes() {
    std::string data;
    if (content_.message_count > 0) data = has(kChunks) ? chunked() : records();
    const std::uint64_t attachment_at = header().size() + data.size();
    if (content_.has_attachment) data += attachment();
    if (content_.has_metadata)
      data += padded(record(12, text("myMetadata") + texts({{"foo", "bar"}})));
    return file(data, summary(attachment_at, header().size() + data.size() - attachment_at));
  }

 private:
  [[nodiscard]] bool has(Feature feature) const { return (features_ & feature) != 0; }
  /// Adds bytes behind a record's fields, if the vector has them.
  [[nodiscard]] std::string padded(const std::string& whole) const {
    if (!has(kPadding)) return whole;
    return record(whole[0], whole.substr(9) + "\x01\x02\x03");
  }
  [[nodiscard]] std::string schema_record() const {
    return content_.has_schema ? padded(schema(1, "Example")) : "";
  }
  [[nodiscard]] std::string channel_record() const {
    return padded(channel(1, content_.has_schema ? 1 : 0, "example"));
  }
  [[nodiscard]] std::string records() {
    std::string all = schema_record() + channel_record();
    for (int i = 0; i < content_.message_count; ++i) {
      index_ += u64(static_cast<std::uint64_t>(i)) + u64(all.size());
      // The rest of a message is its data, so there is nothing to pad.
      all +=
          message(1, static_cast<std::uint64_t>(i), static_cast<std::uint64_t>(i), "\x01\x02\x03");
    }
    return all;
  }
  [[nodiscard]] std::string chunked() {
    const auto last = static_cast<std::uint64_t>(content_.message_count - 1);
    const std::string whole = padded(chunk(0, last, records()));
    chunk_size_ = whole.size();
    return has(kMessageIndex) ? whole + padded(record(7, u16(1) + text(index_))) : whole;
  }
  [[nodiscard]] std::string attachment() const {
    const std::string fields =
        u64(2) + u64(1) + text("myFile") + text("text/plain") + u64(3) + "\x01\x02\x03";
    return padded(record(9, fields + u32(crc(fields))));
  }
  [[nodiscard]] std::string summary(std::uint64_t extra_at, std::uint64_t extra_size) const {
    const auto count = static_cast<std::uint64_t>(content_.message_count);
    const std::uint64_t last = count > 0 ? count - 1 : 0;
    std::string all;
    if (has(kRepeatedSchemas)) all += schema_record();
    if (has(kRepeatedChannels)) all += channel_record();
    if (has(kStatistics)) {
      const Counts counts{.messages = count,
                          .schemas = content_.has_schema ? 1U : 0U,
                          .channels = count > 0 ? 1U : 0U,
                          .attachments = content_.has_attachment ? 1U : 0U,
                          .metadata = content_.has_metadata ? 1U : 0U,
                          .chunks = has(kChunks) ? 1U : 0U};
      all += padded(statistics(counts, 0, last,
                               count > 0 ? std::map<std::uint16_t, std::uint64_t>{{1, count}}
                                         : std::map<std::uint16_t, std::uint64_t>{}));
    }
    if (has(kAttachmentIndex)) {
      all += padded(record(10, u64(extra_at) + u64(extra_size) + u64(2) + u64(1) + u64(3) +
                                   text("myFile") + text("text/plain")));
    }
    if (has(kMetadataIndex)) {
      all += padded(record(13, u64(extra_at) + u64(extra_size) + text("myMetadata")));
    }
    if (has(kChunkIndex)) {
      std::map<std::uint16_t, std::uint64_t> offsets;
      if (has(kMessageIndex)) offsets[1] = header().size() + chunk_size_;
      all += padded(chunk_index(0, last, header().size(), chunk_size_, offsets));
    }
    if (has(kSummaryOffsets) && !all.empty()) all += padded(record(14, '\x0b' + u64(0) + u64(0)));
    return all;
  }

  const Content& content_;
  unsigned features_;
  std::string index_{};
  std::uint64_t chunk_size_ = 0;
};

}  // namespace rtpm::recording::foreign
