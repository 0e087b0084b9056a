#include "records.hpp"

#include <zlib.h>

#include <algorithm>

namespace rtpm::recording {
namespace {

std::string take_string(ByteReader& reader) {
  const ConstBytes text = reader.take_bytes(reader.take<std::uint32_t>());
  return {reinterpret_cast<const char*>(text.data()), text.size()};
}

std::map<std::string, std::string> take_texts(ByteReader& reader) {
  std::map<std::string, std::string> texts;
  const ConstBytes bytes = reader.take_bytes(reader.take<std::uint32_t>());
  ByteReader entries(bytes);
  while (entries.ok() && entries.left() > 0) {
    std::string key = take_string(entries);
    texts[std::move(key)] = take_string(entries);
  }
  if (!entries.ok()) static_cast<void>(reader.take_bytes(reader.left() + 1));
  return texts;
}

std::map<std::uint16_t, std::uint64_t> take_numbers(ByteReader& reader) {
  std::map<std::uint16_t, std::uint64_t> numbers;
  const ConstBytes bytes = reader.take_bytes(reader.take<std::uint32_t>());
  ByteReader entries(bytes);
  while (entries.ok() && entries.left() > 0) {
    const auto key = entries.take<std::uint16_t>();
    numbers[key] = entries.take<std::uint64_t>();
  }
  if (!entries.ok()) static_cast<void>(reader.take_bytes(reader.left() + 1));
  return numbers;
}

template <class T>
std::optional<T> if_ok(const ByteReader& reader, T value) {
  if (!reader.ok()) return std::nullopt;
  return value;
}

}  // namespace

std::uint32_t crc32(ConstBytes bytes, std::uint32_t crc) noexcept {
  return static_cast<std::uint32_t>(
      ::crc32_z(crc, reinterpret_cast<const Bytef*>(bytes.data()), bytes.size()));
}

void add(const Message& message, Statistics& statistics) {
  const std::uint64_t time_ns = message.log_time_ns;
  const bool is_first = statistics.message_count++ == 0;
  statistics.begin_ns = is_first ? time_ns : std::min(statistics.begin_ns, time_ns);
  statistics.end_ns = std::max(statistics.end_ns, time_ns);
  ++statistics.message_counts[message.channel_id];
}

// ---- writing ------------------------------------------------------------------------------------

template <std::unsigned_integral T>
void RecordWriter::put(T value) {
  const std::size_t offset = bytes_.size();
  bytes_.resize(offset + sizeof value);
  store_le(bytes_.data() + offset, value);
}

void RecordWriter::put_bytes(ConstBytes bytes) {
  bytes_.insert(bytes_.end(), bytes.begin(), bytes.end());
}

void RecordWriter::put(std::string_view text) {
  put(static_cast<std::uint32_t>(text.size()));
  put_bytes(std::as_bytes(std::span(text)));
}

void RecordWriter::put(const std::map<std::string, std::string>& texts) {
  std::size_t size = 0;
  for (const auto& [key, value] : texts)
    size += 8 + key.size() + value.size();
  put(static_cast<std::uint32_t>(size));
  for (const auto& [key, value] : texts) {
    put(std::string_view(key));
    put(std::string_view(value));
  }
}

void RecordWriter::put(const std::map<std::uint16_t, std::uint64_t>& numbers) {
  put(static_cast<std::uint32_t>(10 * numbers.size()));
  for (const auto& [key, value] : numbers) {
    put(key);
    put(value);
  }
}

std::size_t RecordWriter::begin(Opcode opcode) {
  put(static_cast<std::uint8_t>(opcode));
  put(std::uint64_t{0});
  return bytes_.size();
}

void RecordWriter::end(std::size_t content_offset) {
  store_le(bytes_.data() + content_offset - sizeof(std::uint64_t),
           static_cast<std::uint64_t>(bytes_.size() - content_offset));
}

void RecordWriter::header(std::string_view profile, std::string_view library) {
  const std::size_t content = begin(Opcode::kHeader);
  put(profile);
  put(library);
  end(content);
}

void RecordWriter::footer(const Footer& footer) {
  const std::size_t content = begin(Opcode::kFooter);
  put(footer.summary_begin);
  put(footer.summary_offsets_begin);
  put(footer.summary_crc);
  end(content);
}

void RecordWriter::schema(std::uint16_t id, const Schema& schema) {
  const std::size_t content = begin(Opcode::kSchema);
  put(id);
  put(std::string_view(schema.name));
  put(std::string_view(schema.encoding));
  put(static_cast<std::uint32_t>(schema.data.size()));
  put_bytes(schema.data);
  end(content);
}

void RecordWriter::channel(std::uint16_t id, const Channel& channel) {
  const std::size_t content = begin(Opcode::kChannel);
  put(id);
  put(channel.schema_id);
  put(std::string_view(channel.topic));
  put(std::string_view(channel.message_encoding));
  put(channel.metadata);
  end(content);
}

void RecordWriter::message(const Message& message) {
  const std::size_t content = begin(Opcode::kMessage);
  put(message.channel_id);
  put(message.sequence);
  put(message.log_time_ns);
  put(message.publish_time_ns);
  put_bytes(message.data);
  end(content);
}

void RecordWriter::chunk(const ChunkHead& chunk) {
  const std::size_t content = begin(Opcode::kChunk);
  put(chunk.begin_ns);
  put(chunk.end_ns);
  put(chunk.uncompressed_size);
  put(chunk.uncompressed_crc);
  put(std::string_view(chunk.compression));
  put(static_cast<std::uint64_t>(chunk.records.size()));
  put_bytes(chunk.records);
  end(content);
}

void RecordWriter::message_index(
    std::uint16_t channel_id, const std::vector<std::pair<std::uint64_t, std::uint64_t>>& entries) {
  const std::size_t content = begin(Opcode::kMessageIndex);
  put(channel_id);
  put(static_cast<std::uint32_t>(16 * entries.size()));
  for (const auto& [log_time_ns, offset] : entries) {
    put(log_time_ns);
    put(offset);
  }
  end(content);
}

void RecordWriter::chunk_index(const ChunkIndex& index) {
  const std::size_t content = begin(Opcode::kChunkIndex);
  put(index.begin_ns);
  put(index.end_ns);
  put(index.chunk_offset);
  put(index.chunk_size);
  put(index.index_offsets);
  put(index.indexes_size);
  put(std::string_view(index.compression));
  put(index.compressed_size);
  put(index.uncompressed_size);
  end(content);
}

void RecordWriter::attachment(const Attachment& attachment) {
  const std::size_t content = begin(Opcode::kAttachment);
  put(attachment.log_time_ns);
  put(attachment.create_time_ns);
  put(std::string_view(attachment.name));
  put(std::string_view(attachment.media_type));
  put(static_cast<std::uint64_t>(attachment.data.size()));
  put_bytes(attachment.data);
  put(crc32(ConstBytes(bytes_).subspan(content)));
  end(content);
}

void RecordWriter::attachment_index(const AttachmentIndex& index) {
  const std::size_t content = begin(Opcode::kAttachmentIndex);
  put(index.offset);
  put(index.size);
  put(index.log_time_ns);
  put(index.create_time_ns);
  put(index.data_size);
  put(std::string_view(index.name));
  put(std::string_view(index.media_type));
  end(content);
}

void RecordWriter::metadata(const Metadata& metadata) {
  const std::size_t content = begin(Opcode::kMetadata);
  put(std::string_view(metadata.name));
  put(metadata.values);
  end(content);
}

void RecordWriter::metadata_index(const MetadataIndex& index) {
  const std::size_t content = begin(Opcode::kMetadataIndex);
  put(index.offset);
  put(index.size);
  put(std::string_view(index.name));
  end(content);
}

void RecordWriter::statistics(const Statistics& statistics, const RecordCounts& counts) {
  const std::size_t content = begin(Opcode::kStatistics);
  put(statistics.message_count);
  put(counts.schemas);
  put(counts.channels);
  put(counts.attachments);
  put(counts.metadata);
  put(statistics.chunk_count);
  put(statistics.begin_ns);
  put(statistics.end_ns);
  put(statistics.message_counts);
  end(content);
}

void RecordWriter::summary_offset(Opcode group, std::uint64_t begin_offset, std::uint64_t size) {
  const std::size_t content = begin(Opcode::kSummaryOffset);
  put(static_cast<std::uint8_t>(group));
  put(begin_offset);
  put(size);
  end(content);
}

void RecordWriter::data_end(std::uint32_t data_crc) {
  const std::size_t content = begin(Opcode::kDataEnd);
  put(data_crc);
  end(content);
}

// ---- reading ------------------------------------------------------------------------------------

std::optional<std::pair<std::uint16_t, Schema>> parse_schema(ConstBytes content) {
  ByteReader reader(content);
  std::pair<std::uint16_t, Schema> found;
  found.first = reader.take<std::uint16_t>();
  found.second.name = take_string(reader);
  found.second.encoding = take_string(reader);
  const ConstBytes data = reader.take_bytes(reader.take<std::uint32_t>());
  found.second.data.assign(data.begin(), data.end());
  // The number 0 means that a channel has no schema.
  if (found.first == 0) return std::nullopt;
  return if_ok(reader, std::move(found));
}

std::optional<std::pair<std::uint16_t, Channel>> parse_channel(ConstBytes content) {
  ByteReader reader(content);
  std::pair<std::uint16_t, Channel> found;
  found.first = reader.take<std::uint16_t>();
  found.second.schema_id = reader.take<std::uint16_t>();
  found.second.topic = take_string(reader);
  found.second.message_encoding = take_string(reader);
  found.second.metadata = take_texts(reader);
  return if_ok(reader, std::move(found));
}

std::optional<Message> parse_message(ConstBytes content) {
  ByteReader reader(content);
  Message message;
  message.channel_id = reader.take<std::uint16_t>();
  message.sequence = reader.take<std::uint32_t>();
  message.log_time_ns = reader.take<std::uint64_t>();
  message.publish_time_ns = reader.take<std::uint64_t>();
  if (reader.ok()) message.data = reader.take_bytes(reader.left());
  return if_ok(reader, message);
}

std::optional<ChunkHead> parse_chunk(ConstBytes content) {
  ByteReader reader(content);
  ChunkHead chunk;
  chunk.begin_ns = reader.take<std::uint64_t>();
  chunk.end_ns = reader.take<std::uint64_t>();
  chunk.uncompressed_size = reader.take<std::uint64_t>();
  chunk.uncompressed_crc = reader.take<std::uint32_t>();
  chunk.compression = take_string(reader);
  chunk.records = reader.take_bytes(reader.take<std::uint64_t>());
  return if_ok(reader, std::move(chunk));
}

std::optional<ChunkIndex> parse_chunk_index(ConstBytes content) {
  ByteReader reader(content);
  ChunkIndex index;
  index.begin_ns = reader.take<std::uint64_t>();
  index.end_ns = reader.take<std::uint64_t>();
  index.chunk_offset = reader.take<std::uint64_t>();
  index.chunk_size = reader.take<std::uint64_t>();
  index.index_offsets = take_numbers(reader);
  index.indexes_size = reader.take<std::uint64_t>();
  index.compression = take_string(reader);
  index.compressed_size = reader.take<std::uint64_t>();
  index.uncompressed_size = reader.take<std::uint64_t>();
  return if_ok(reader, std::move(index));
}

std::optional<Attachment> parse_attachment(ConstBytes content) {
  ByteReader reader(content);
  Attachment attachment;
  attachment.log_time_ns = reader.take<std::uint64_t>();
  attachment.create_time_ns = reader.take<std::uint64_t>();
  attachment.name = take_string(reader);
  attachment.media_type = take_string(reader);
  const ConstBytes data = reader.take_bytes(reader.take<std::uint64_t>());
  attachment.data.assign(data.begin(), data.end());
  const std::size_t checked_size = content.size() - reader.left();
  const auto crc = reader.take<std::uint32_t>();
  if (reader.ok() && crc != 0 && crc != crc32(content.first(checked_size))) return std::nullopt;
  return if_ok(reader, std::move(attachment));
}

std::optional<Metadata> parse_metadata(ConstBytes content) {
  ByteReader reader(content);
  Metadata metadata;
  metadata.name = take_string(reader);
  metadata.values = take_texts(reader);
  return if_ok(reader, std::move(metadata));
}

std::optional<StatedStatistics> parse_statistics(ConstBytes content) {
  ByteReader reader(content);
  StatedStatistics stated;
  Statistics& statistics = stated.statistics;
  statistics.message_count = reader.take<std::uint64_t>();
  stated.counts.schemas = reader.take<std::uint16_t>();
  stated.counts.channels = reader.take<std::uint32_t>();
  stated.counts.attachments = reader.take<std::uint32_t>();
  stated.counts.metadata = reader.take<std::uint32_t>();
  statistics.chunk_count = reader.take<std::uint32_t>();
  statistics.begin_ns = reader.take<std::uint64_t>();
  statistics.end_ns = reader.take<std::uint64_t>();
  statistics.message_counts = take_numbers(reader);
  if (statistics.begin_ns > statistics.end_ns) return std::nullopt;
  return if_ok(reader, std::move(stated));
}

std::optional<Footer> parse_footer(ConstBytes content) {
  ByteReader reader(content);
  Footer footer;
  footer.summary_begin = reader.take<std::uint64_t>();
  footer.summary_offsets_begin = reader.take<std::uint64_t>();
  footer.summary_crc = reader.take<std::uint32_t>();
  return if_ok(reader, footer);
}

std::optional<std::uint32_t> parse_data_end(ConstBytes content) {
  ByteReader reader(content);
  const auto crc = reader.take<std::uint32_t>();
  return if_ok(reader, crc);
}

}  // namespace rtpm::recording
