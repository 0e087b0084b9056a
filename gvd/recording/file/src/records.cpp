#include "records.hpp"

#include <zlib.h>

#include <algorithm>
#include <concepts>

namespace rtpm::recording {
namespace {

using Texts = std::map<std::string, std::string>;
using Numbers = std::map<std::uint16_t, std::uint64_t>;
using Entries = std::vector<std::pair<std::uint64_t, std::uint64_t>>;

/// Appends fields to a buffer.
class FieldWriter {
 public:
  explicit FieldWriter(std::vector<std::byte>& bytes) noexcept
      : bytes_(bytes), begin_(bytes.size()) {}

  template <class... T>
  void operator()(const T&... fields) {
    (put(fields), ...);
  }
  /// Writes bytes, preceded by their size.
  template <std::unsigned_integral Size>
  void sized(ConstBytes bytes) {
    put(static_cast<Size>(bytes.size()));
    rest(bytes);
  }
  void rest(ConstBytes bytes) { bytes_.insert(bytes_.end(), bytes.begin(), bytes.end()); }
  /// Writes the checksum of all fields before it.
  void crc() { put(crc32(ConstBytes(bytes_).subspan(begin_))); }

 private:
  template <std::unsigned_integral T>
  void put(T value) {
    const std::size_t offset = bytes_.size();
    bytes_.resize(offset + sizeof value);
    store_le(bytes_.data() + offset, value);
  }
  void put(Opcode opcode) { put(static_cast<std::uint8_t>(opcode)); }
  void put(const std::string& text) { sized<std::uint32_t>(std::as_bytes(std::span(text))); }
  /// Writes entries, preceded by their total size in bytes.
  template <class List>
  void put_entries(const List& list) {
    const std::size_t size_at = bytes_.size();
    put(std::uint32_t{0});
    for (const auto& [first, second] : list)
      (*this)(first, second);
    store_le(bytes_.data() + size_at,
             static_cast<std::uint32_t>(bytes_.size() - size_at - sizeof(std::uint32_t)));
  }
  void put(const Texts& texts) { put_entries(texts); }
  void put(const Numbers& numbers) { put_entries(numbers); }
  void put(const Entries& entries) { put_entries(entries); }

  std::vector<std::byte>& bytes_;
  std::size_t begin_;
};

/// Reads fields, as FieldWriter writes them.
class FieldReader {
 public:
  explicit FieldReader(ConstBytes content) noexcept : content_(content), reader_(content) {}

  template <class... T>
  void operator()(T&... fields) {
    (take(fields), ...);
  }
  template <std::unsigned_integral Size, class Bytes>
  void sized(Bytes& bytes) {
    const ConstBytes taken = reader_.take_bytes(reader_.take<Size>());
    bytes = Bytes(taken.begin(), taken.end());
  }
  void rest(ConstBytes& bytes) { bytes = reader_.take_bytes(reader_.left()); }
  void crc() {
    const std::size_t checked_size = content_.size() - reader_.left();
    const auto stated = reader_.take<std::uint32_t>();
    is_sound_ = stated == 0 || stated == crc32(content_.first(checked_size));
  }
  [[nodiscard]] bool ok() const noexcept { return reader_.ok() && is_sound_; }

 private:
  template <std::unsigned_integral T>
  void take(T& value) {
    value = reader_.take<T>();
  }
  void take(std::string& text) {
    const ConstBytes bytes = reader_.take_bytes(reader_.take<std::uint32_t>());
    text.assign(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  }
  template <class Map>
  void take_entries(Map& map) {
    FieldReader entries(reader_.take_bytes(reader_.take<std::uint32_t>()));
    while (entries.ok() && entries.reader_.left() > 0) {
      std::pair<typename Map::key_type, typename Map::mapped_type> entry;
      entries(entry.first, entry.second);
      map.insert_or_assign(std::move(entry.first), std::move(entry.second));
    }
    is_sound_ = is_sound_ && entries.ok();
  }
  void take(Texts& texts) { take_entries(texts); }
  void take(Numbers& numbers) { take_entries(numbers); }

  ConstBytes content_;
  ByteReader reader_;
  bool is_sound_ = true;
};

template <class T, class Record>
concept Is = std::same_as<std::remove_const_t<T>, Record>;

// The opcode of each record, and its fields in order, for reading and writing.

template <class Record>
constexpr Opcode kOpcodeOf{};
template <>
constexpr Opcode kOpcodeOf<Header> = Opcode::kHeader;
void fields(auto& io, Is<Header> auto& header) {
  io(header.profile, header.library);
}

template <>
constexpr Opcode kOpcodeOf<Footer> = Opcode::kFooter;
void fields(auto& io, Is<Footer> auto& footer) {
  io(footer.summary_begin, footer.summary_offsets_begin, footer.summary_crc);
}

template <>
constexpr Opcode kOpcodeOf<NumberedSchema> = Opcode::kSchema;
void fields(auto& io, Is<NumberedSchema> auto& schema) {
  io(schema.first, schema.second.name, schema.second.encoding);
  io.template sized<std::uint32_t>(schema.second.data);
}

template <>
constexpr Opcode kOpcodeOf<NumberedChannel> = Opcode::kChannel;
void fields(auto& io, Is<NumberedChannel> auto& numbered) {
  auto& channel = numbered.second;
  io(numbered.first, channel.schema_id, channel.topic, channel.message_encoding, channel.metadata);
}

template <>
constexpr Opcode kOpcodeOf<Message> = Opcode::kMessage;
void fields(auto& io, Is<Message> auto& message) {
  io(message.channel_id, message.sequence, message.log_time_ns, message.publish_time_ns);
  io.rest(message.data);
}

template <>
constexpr Opcode kOpcodeOf<ChunkHead> = Opcode::kChunk;
void fields(auto& io, Is<ChunkHead> auto& chunk) {
  io(chunk.begin_ns, chunk.end_ns, chunk.uncompressed_size, chunk.uncompressed_crc,
     chunk.compression);
  io.template sized<std::uint64_t>(chunk.records);
}

template <>
constexpr Opcode kOpcodeOf<MessageIndex> = Opcode::kMessageIndex;
void fields(auto& io, Is<MessageIndex> auto& index) {
  io(index.first, index.second);
}

template <>
constexpr Opcode kOpcodeOf<ChunkIndex> = Opcode::kChunkIndex;
void fields(auto& io, Is<ChunkIndex> auto& index) {
  io(index.begin_ns, index.end_ns, index.chunk_offset, index.chunk_size, index.index_offsets,
     index.indexes_size, index.compression, index.compressed_size, index.uncompressed_size);
}

template <>
constexpr Opcode kOpcodeOf<Attachment> = Opcode::kAttachment;
void fields(auto& io, Is<Attachment> auto& attachment) {
  io(attachment.log_time_ns, attachment.create_time_ns, attachment.name, attachment.media_type);
  io.template sized<std::uint64_t>(attachment.data);
  io.crc();
}

template <>
constexpr Opcode kOpcodeOf<AttachmentIndex> = Opcode::kAttachmentIndex;
void fields(auto& io, Is<AttachmentIndex> auto& index) {
  io(index.offset, index.size, index.log_time_ns, index.create_time_ns, index.data_size, index.name,
     index.media_type);
}

template <>
constexpr Opcode kOpcodeOf<StatedStatistics> = Opcode::kStatistics;
void fields(auto& io, Is<StatedStatistics> auto& stated) {
  auto& statistics = stated.statistics;
  io(statistics.message_count, stated.schema_count, stated.channel_count, stated.attachment_count,
     stated.metadata_count, statistics.chunk_count, statistics.begin_ns, statistics.end_ns,
     statistics.message_counts);
}

template <>
constexpr Opcode kOpcodeOf<Metadata> = Opcode::kMetadata;
void fields(auto& io, Is<Metadata> auto& metadata) {
  io(metadata.name, metadata.values);
}

template <>
constexpr Opcode kOpcodeOf<MetadataIndex> = Opcode::kMetadataIndex;
void fields(auto& io, Is<MetadataIndex> auto& index) {
  io(index.offset, index.size, index.name);
}

template <>
constexpr Opcode kOpcodeOf<SummaryOffset> = Opcode::kSummaryOffset;
void fields(auto& io, Is<SummaryOffset> auto& offset) {
  io(offset.group, offset.begin, offset.size);
}

template <>
constexpr Opcode kOpcodeOf<DataEnd> = Opcode::kDataEnd;
void fields(auto& io, Is<DataEnd> auto& end) {
  io(end.data_crc);
}

template <class Record>
bool is_consistent(const Record&) {
  return true;
}
// Channels use the number 0 for "no schema".
bool is_consistent(const NumberedSchema& schema) {
  return schema.first != 0;
}
bool is_consistent(const StatedStatistics& stated) {
  return stated.statistics.begin_ns <= stated.statistics.end_ns;
}

}  // namespace

template <class Record>
void append(std::vector<std::byte>& bytes, const Record& record) {
  FieldWriter head(bytes);
  head(kOpcodeOf<Record>, std::uint64_t{0});  // Replaced by the size at the end.
  const std::size_t content_offset = bytes.size();
  FieldWriter content(bytes);
  fields(content, record);
  store_le(bytes.data() + content_offset - sizeof(std::uint64_t),
           static_cast<std::uint64_t>(bytes.size() - content_offset));
}

template <class Record>
std::optional<Record> parse(ConstBytes content) {
  FieldReader reader(content);
  Record record{};
  fields(reader, record);
  if (!reader.ok() || !is_consistent(record)) return std::nullopt;
  return record;
}

template void append(std::vector<std::byte>&, const Header&);
template void append(std::vector<std::byte>&, const Footer&);
template void append(std::vector<std::byte>&, const NumberedSchema&);
template void append(std::vector<std::byte>&, const NumberedChannel&);
template void append(std::vector<std::byte>&, const Message&);
template void append(std::vector<std::byte>&, const ChunkHead&);
template void append(std::vector<std::byte>&, const MessageIndex&);
template void append(std::vector<std::byte>&, const ChunkIndex&);
template void append(std::vector<std::byte>&, const Attachment&);
template void append(std::vector<std::byte>&, const AttachmentIndex&);
template void append(std::vector<std::byte>&, const StatedStatistics&);
template void append(std::vector<std::byte>&, const Metadata&);
template void append(std::vector<std::byte>&, const MetadataIndex&);
template void append(std::vector<std::byte>&, const SummaryOffset&);
template void append(std::vector<std::byte>&, const DataEnd&);

template std::optional<Footer> parse(ConstBytes);
template std::optional<NumberedSchema> parse(ConstBytes);
template std::optional<NumberedChannel> parse(ConstBytes);
template std::optional<Message> parse(ConstBytes);
template std::optional<ChunkHead> parse(ConstBytes);
template std::optional<ChunkIndex> parse(ConstBytes);
template std::optional<Attachment> parse(ConstBytes);
template std::optional<StatedStatistics> parse(ConstBytes);
template std::optional<Metadata> parse(ConstBytes);
template std::optional<DataEnd> parse(ConstBytes);

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

}  // namespace rtpm::recording
