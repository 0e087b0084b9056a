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

/// MCAP's records as bytes. Numbers are little-endian; a string is preceded by its 32-bit size; a
/// list or map is preceded by the 32-bit total size of its entries, in bytes.
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

/// The position of an attachment or metadata.
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

struct Header {
  std::string profile{};
  std::string library{};
};

struct Footer {
  std::uint64_t summary_begin = 0;  ///< 0 if there is no summary.
  std::uint64_t summary_offsets_begin = 0;
  std::uint32_t summary_crc = 0;  ///< 0 if none.
};

/// The statistics in the summary, with numbers of records.
struct StatedStatistics {
  Statistics statistics{};
  std::uint16_t schema_count = 0;
  std::uint32_t channel_count = 0;
  std::uint32_t attachment_count = 0;
  std::uint32_t metadata_count = 0;
};

struct SummaryOffset {
  Opcode group{};
  std::uint64_t begin = 0;
  std::uint64_t size = 0;
};

struct DataEnd {
  std::uint32_t data_crc = 0;  ///< 0 if none.
};

/// A schema or channel with its number.
using NumberedSchema = std::pair<std::uint16_t, Schema>;
using NumberedChannel = std::pair<std::uint16_t, Channel>;
/// For each message of a channel: log time in ns, and offset in the chunk's uncompressed records.
using MessageIndex = std::pair<std::uint16_t, std::vector<std::pair<std::uint64_t, std::uint64_t>>>;

/// Appends a record, with its opcode and size.
/// @param record  any of the types above, or of Message, Attachment and Metadata
template <class Record>
void append(std::vector<std::byte>& bytes, const Record& record);

/// Parses a record from untrusted bytes; nullopt if too short or inconsistent. Skips bytes after
/// the known fields, as the format demands.
template <class Record>
[[nodiscard]] std::optional<Record> parse(ConstBytes content);

/// Counts a message.
void add(const Message& message, Statistics& statistics);

/// Continues an ISO-HDLC CRC-32 from `crc`, using zlib's fast implementation, because recordings
/// are large.
[[nodiscard]] std::uint32_t crc32(ConstBytes bytes, std::uint32_t crc = 0) noexcept;

}  // namespace rtpm::recording
