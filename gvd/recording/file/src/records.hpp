#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "rtpm/base/bytes.hpp"
#include "rtpm/recording/mcap.hpp"

/// MCAP's records as bytes. Numbers are little-endian; a string begins with its size, 32 bits; a
/// list or map begins with the size of all its entries in bytes, 32 bits.
/// @source   https://mcap.dev/spec, "Records"
namespace rtpm::recording {

inline constexpr std::array<std::uint8_t, 8> kMagic{0x89, 'M', 'C', 'A', 'P', '0', '\r', '\n'};
inline constexpr std::size_t kMagicSize = kMagic.size();
inline constexpr std::size_t kRecordHeaderSize = 9;  ///< Opcode and 64-bit size of the content.
inline constexpr std::size_t kFooterContentSize = 20;

enum class Opcode : std::uint8_t {
  kHeader = 0x01,
  kFooter = 0x02,
  kSchema = 0x03,
  kChannel = 0x04,
  kMessage = 0x05,
  kChunk = 0x06,
  kMessageIndex = 0x07,
  kChunkIndex = 0x08,
  kAttachment = 0x09,
  kAttachmentIndex = 0x0a,
  kStatistics = 0x0b,
  kMetadata = 0x0c,
  kMetadataIndex = 0x0d,
  kSummaryOffset = 0x0e,
  kDataEnd = 0x0f,
};

/// (Log time in ns, offset among the chunk's uncompressed records) of each message of a channel.
using MessageIndexes =
    std::map<std::uint16_t, std::vector<std::pair<std::uint64_t, std::uint64_t>>>;

struct ChunkHead {
  std::uint64_t begin_ns = 0;
  std::uint64_t end_ns = 0;
  std::uint64_t uncompressed_size = 0;
  std::uint32_t uncompressed_crc = 0;  ///< 0 if none.
  std::string compression;             ///< "", "lz4" or "zstd".
  ConstBytes records;                  ///< The compressed records.
};

struct ChunkIndex {
  std::uint64_t begin_ns = 0;
  std::uint64_t end_ns = 0;
  std::uint64_t chunk_offset = 0;
  std::uint64_t chunk_size = 0;
  std::map<std::uint16_t, std::uint64_t> index_offsets{};
  std::uint64_t indexes_size = 0;
  std::string compression;
  std::uint64_t compressed_size = 0;
  std::uint64_t uncompressed_size = 0;
};

/// The place of an attachment or metadata.
struct RecordIndex {
  std::uint64_t offset = 0;
  std::uint64_t size = 0;
};
struct AttachmentIndex : RecordIndex {
  std::uint64_t log_time_ns = 0;
  std::uint64_t create_time_ns = 0;
  std::uint64_t data_size = 0;
  std::string name;
  std::string media_type;
};
struct MetadataIndex : RecordIndex {
  std::string name;
};

struct Footer {
  std::uint64_t summary_begin = 0;  ///< 0 if there is no summary.
  std::uint64_t summary_offsets_begin = 0;
  std::uint32_t summary_crc = 0;  ///< 0 if none.
};

/// Numbers of records that the summary states in addition to Statistics.
struct RecordCounts {
  std::uint16_t schemas = 0;
  std::uint32_t channels = 0;
  std::uint32_t attachments = 0;
  std::uint32_t metadata = 0;
};

/// The statistics that the summary states.
struct StatedStatistics {
  Statistics statistics{};
  RecordCounts counts{};
};

/// Appends records to a buffer.
/// @ownership refers to the buffer, which must outlive it
class RecordWriter {
 public:
  explicit RecordWriter(std::vector<std::byte>& bytes) noexcept : bytes_(bytes) {}

  void header(std::string_view profile, std::string_view library);
  void footer(const Footer& footer);
  void schema(std::uint16_t id, const Schema& schema);
  void channel(std::uint16_t id, const Channel& channel);
  void message(const Message& message);
  void chunk(const ChunkHead& chunk);
  void message_index(std::uint16_t channel_id,
                     const std::vector<std::pair<std::uint64_t, std::uint64_t>>& entries);
  void chunk_index(const ChunkIndex& index);
  void attachment(const Attachment& attachment);
  void attachment_index(const AttachmentIndex& index);
  void metadata(const Metadata& metadata);
  void metadata_index(const MetadataIndex& index);
  void statistics(const Statistics& statistics, const RecordCounts& counts);
  void summary_offset(Opcode group, std::uint64_t begin, std::uint64_t size);
  void data_end(std::uint32_t data_crc);

 private:
  /// Writes the head of a record; end() fills in the size of the content.
  std::size_t begin(Opcode opcode);
  void end(std::size_t content_offset);
  template <std::unsigned_integral T>
  void put(T value);
  void put(std::string_view text);
  void put_bytes(ConstBytes bytes);
  void put(const std::map<std::string, std::string>& texts);
  void put(const std::map<std::uint16_t, std::uint64_t>& numbers);

  std::vector<std::byte>& bytes_;
};

/// The contents of records, from untrusted bytes; nullopt if too short or inconsistent.
/// Bytes after the known fields are skipped, as the format demands.
[[nodiscard]] std::optional<std::pair<std::uint16_t, Schema>> parse_schema(ConstBytes content);
[[nodiscard]] std::optional<std::pair<std::uint16_t, Channel>> parse_channel(ConstBytes content);
[[nodiscard]] std::optional<Message> parse_message(ConstBytes content);
[[nodiscard]] std::optional<ChunkHead> parse_chunk(ConstBytes content);
[[nodiscard]] std::optional<ChunkIndex> parse_chunk_index(ConstBytes content);
[[nodiscard]] std::optional<Attachment> parse_attachment(ConstBytes content);
[[nodiscard]] std::optional<Metadata> parse_metadata(ConstBytes content);
[[nodiscard]] std::optional<StatedStatistics> parse_statistics(ConstBytes content);
[[nodiscard]] std::optional<Footer> parse_footer(ConstBytes content);
[[nodiscard]] std::optional<std::uint32_t> parse_data_end(ConstBytes content);

/// Counts a message.
void add(const Message& message, Statistics& statistics);

/// Continues the CRC-32 of ISO-HDLC from `crc`. It uses zlib's fast implementation, because
/// recordings are large.
[[nodiscard]] std::uint32_t crc32(ConstBytes bytes, std::uint32_t crc = 0) noexcept;

}  // namespace rtpm::recording
