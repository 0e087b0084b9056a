#include "rtpm/recording/file_writer.hpp"

#include <algorithm>
#include <array>
#include <functional>
#include <string_view>
#include <unordered_map>
#include <utility>

#include "compression.hpp"
#include "output_file.hpp"
#include "records.hpp"
#include "rtpm/base/assert.hpp"

namespace rtpm::recording {
namespace {

constexpr const char* kLibrary = "rtpm";
constexpr std::size_t kNumberMax = 65535;

std::size_t hash_of(const Schema& schema) {
  const std::string_view data(reinterpret_cast<const char*>(schema.data.data()),
                              schema.data.size());
  return std::hash<std::string>{}(schema.name) ^ std::hash<std::string_view>{}(data);
}
std::size_t hash_of(const Channel& channel) {
  return std::hash<std::string>{}(channel.topic) + channel.schema_id;
}

/// Values with numbers, from 1.
template <class T>
class Numbered {
 public:
  /// Returns the number of `value`, adding it if necessary, and whether it was added; 0 if all
  /// numbers are used.
  std::pair<std::uint16_t, bool> number_of(const T& value) {
    const std::size_t hash = hash_of(value);
    const auto [first, last] = numbers_.equal_range(hash);
    for (auto known = first; known != last; ++known) {
      if (values_[known->second - 1U].second == value) return {known->second, false};
    }
    if (values_.size() == kNumberMax) return {std::uint16_t{0}, false};
    const auto number = static_cast<std::uint16_t>(values_.size() + 1);
    values_.emplace_back(number, value);
    numbers_.emplace(hash, number);
    return {number, true};
  }
  [[nodiscard]] const std::vector<std::pair<std::uint16_t, T>>& numbered() const noexcept {
    return values_;
  }

 private:
  std::vector<std::pair<std::uint16_t, T>> values_{};
  std::unordered_multimap<std::size_t, std::uint16_t> numbers_{};  ///< Keyed by hash.
};

}  // namespace

struct FileWriter::Impl {
  Impl(OutputFile opened, WriterConfig writer_config)
      : file(std::move(opened)), config(std::move(writer_config)) {}

  expected<void, SetupError> append() {
    data_crc = crc32(bytes, data_crc);
    return file.append(std::exchange(bytes, {}));
  }
  expected<void, SetupError> end_chunk();
  void write_indexes(std::uint64_t chunk_offset, const ChunkHead& head);
  void write_summary();

  OutputFile file;
  WriterConfig config;
  std::uint32_t data_crc = 0;
  /// Records that the next append() writes to the file.
  std::vector<std::byte> bytes{};

  Numbered<Schema> schemas{};
  Numbered<Channel> channels{};
  Statistics statistics{};

  /// The uncompressed records of the current chunk.
  std::vector<std::byte> chunk{};
  /// The messages of the current chunk, by channel.
  std::map<std::uint16_t, MessageIndex::second_type> indexes{};
  std::uint64_t chunk_begin_ns = 0;
  std::uint64_t chunk_end_ns = 0;

  std::vector<ChunkIndex> chunk_indexes{};
  std::vector<AttachmentIndex> attachment_indexes{};
  std::vector<MetadataIndex> metadata_indexes{};
  std::vector<std::byte> compressed{};
};

expected<void, SetupError> FileWriter::Impl::end_chunk() {
  if (chunk.empty()) return {};
  compress(config.compression, chunk, compressed);
  // Without messages the times are 0.
  const ChunkHead head{.begin_ns = indexes.empty() ? 0 : chunk_begin_ns,
                       .end_ns = indexes.empty() ? 0 : chunk_end_ns,
                       .uncompressed_size = chunk.size(),
                       .uncompressed_crc = crc32(chunk),
                       .compression = std::string(to_string(config.compression)),
                       .records = compressed};
  const std::uint64_t offset = file.size();
  recording::append(bytes, head);
  write_indexes(offset, head);
  chunk.clear();
  indexes.clear();
  return append();
}

void FileWriter::Impl::write_indexes(std::uint64_t chunk_offset, const ChunkHead& head) {
  ChunkIndex index{.begin_ns = head.begin_ns,
                   .end_ns = head.end_ns,
                   .chunk_offset = chunk_offset,
                   .chunk_size = bytes.size(),
                   .compression = head.compression,
                   .compressed_size = head.records.size(),
                   .uncompressed_size = head.uncompressed_size};
  const std::size_t indexes_begin = bytes.size();
  for (auto& [channel_id, entries] : indexes) {
    index.index_offsets[channel_id] = chunk_offset + bytes.size();
    recording::append(bytes, MessageIndex{channel_id, std::move(entries)});
  }
  index.indexes_size = bytes.size() - indexes_begin;
  chunk_indexes.push_back(std::move(index));
  ++statistics.chunk_count;
}

/// Writes the bytes from the summary on; `bytes` must be empty.
void FileWriter::Impl::write_summary() {
  const std::uint64_t begin = file.size();
  std::vector<SummaryOffset> groups;
  const auto add = [&](Opcode opcode, const auto& records) {
    const std::size_t from = bytes.size();
    for (const auto& record : records)
      recording::append(bytes, record);
    if (bytes.size() > from) groups.push_back({opcode, begin + from, bytes.size() - from});
  };
  add(Opcode::kSchema, schemas.numbered());
  add(Opcode::kChannel, channels.numbered());
  add(Opcode::kStatistics,
      std::array{StatedStatistics{
          .statistics = statistics,
          .schema_count = static_cast<std::uint16_t>(schemas.numbered().size()),
          .channel_count = static_cast<std::uint32_t>(channels.numbered().size()),
          .attachment_count = static_cast<std::uint32_t>(attachment_indexes.size()),
          .metadata_count = static_cast<std::uint32_t>(metadata_indexes.size())}});
  add(Opcode::kChunkIndex, chunk_indexes);
  add(Opcode::kAttachmentIndex, attachment_indexes);
  add(Opcode::kMetadataIndex, metadata_indexes);
  const std::uint64_t offsets_begin = begin + bytes.size();
  for (const SummaryOffset& group : groups)
    recording::append(bytes, group);

  // The checksum covers the footer up to itself.
  recording::append(bytes, Footer{.summary_begin = begin, .summary_offsets_begin = offsets_begin});
  const std::size_t crc_offset = bytes.size() - sizeof(std::uint32_t);
  store_le(bytes.data() + crc_offset, crc32(ConstBytes(bytes).first(crc_offset)));
}

expected<std::unique_ptr<FileWriter>, SetupError> FileWriter::create(const std::string& path,
                                                                     WriterConfig config) {
  auto file = OutputFile::create(path);
  if (!file) return unexpected{file.error()};
  auto impl = std::make_unique<Impl>(std::move(*file), std::move(config));
  const auto magic = std::as_bytes(std::span(kMagic));
  impl->bytes.assign(magic.begin(), magic.end());
  append(impl->bytes, Header{impl->config.profile, kLibrary});
  if (auto written = impl->append(); !written) return unexpected{written.error()};
  return std::unique_ptr<FileWriter>(new FileWriter(std::move(impl)));
}

FileWriter::FileWriter(std::unique_ptr<Impl> impl) noexcept : impl_(std::move(impl)) {}

FileWriter::~FileWriter() {
  if (impl_->file.is_open()) static_cast<void>(close());
}

expected<std::uint16_t, SetupError> FileWriter::add_schema(const Schema& schema) {
  const auto [number, is_new] = impl_->schemas.number_of(schema);
  if (number == 0) return setup_error("a recording has at most 65535 schemas");
  if (is_new) append(impl_->chunk, NumberedSchema{number, schema});
  return number;
}

expected<std::uint16_t, SetupError> FileWriter::add_channel(const Channel& channel) {
  if (channel.schema_id > impl_->schemas.numbered().size()) {
    return setup_error("the channel " + channel.topic + " has a schema that was not added");
  }
  const auto [number, is_new] = impl_->channels.number_of(channel);
  if (number == 0) return setup_error("a recording has at most 65535 channels");
  if (is_new) append(impl_->chunk, NumberedChannel{number, channel});
  return number;
}

expected<void, SetupError> FileWriter::write(const Message& message) {
  if (message.channel_id == 0 || message.channel_id > impl_->channels.numbered().size()) {
    return setup_error("a message has a channel that was not added");
  }
  // `begin` and `end` are message times, but a chunk may start with schemas and channels.
  if (impl_->indexes.empty()) impl_->chunk_begin_ns = impl_->chunk_end_ns = message.log_time_ns;
  impl_->chunk_begin_ns = std::min(impl_->chunk_begin_ns, message.log_time_ns);
  impl_->chunk_end_ns = std::max(impl_->chunk_end_ns, message.log_time_ns);
  impl_->indexes[message.channel_id].emplace_back(message.log_time_ns, impl_->chunk.size());
  append(impl_->chunk, message);
  add(message, impl_->statistics);
  return impl_->chunk.size() < impl_->config.chunk_byte_max ? expected<void, SetupError>{}
                                                            : impl_->end_chunk();
}

expected<void, SetupError> FileWriter::write(const Attachment& attachment) {
  if (auto ended = impl_->end_chunk(); !ended) return ended;
  const std::uint64_t offset = impl_->file.size();
  append(impl_->bytes, attachment);
  impl_->attachment_indexes.push_back({{offset, impl_->bytes.size()},
                                       attachment.log_time_ns,
                                       attachment.create_time_ns,
                                       attachment.data.size(),
                                       attachment.name,
                                       attachment.media_type});
  return impl_->append();
}

expected<void, SetupError> FileWriter::write(const Metadata& metadata) {
  if (auto ended = impl_->end_chunk(); !ended) return ended;
  const std::uint64_t offset = impl_->file.size();
  append(impl_->bytes, metadata);
  impl_->metadata_indexes.push_back({{offset, impl_->bytes.size()}, metadata.name});
  return impl_->append();
}

expected<void, SetupError> FileWriter::end_chunk() {
  return impl_->end_chunk();
}

expected<void, SetupError> FileWriter::close() {
  RTPM_ASSERT(impl_->file.is_open(), "closed twice");
  if (auto ended = impl_->end_chunk(); !ended) return ended;
  append(impl_->bytes, DataEnd{impl_->data_crc});
  if (auto written = impl_->append(); !written) return written;
  impl_->write_summary();
  const auto magic = std::as_bytes(std::span(kMagic));
  impl_->bytes.insert(impl_->bytes.end(), magic.begin(), magic.end());
  if (auto written = impl_->append(); !written) return written;
  return impl_->file.close();
}

const Statistics& FileWriter::statistics() const noexcept {
  return impl_->statistics;
}

std::uint64_t FileWriter::size() const noexcept {
  return impl_->file.size();
}

}  // namespace rtpm::recording
