#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "os/file.hpp"
#include "records.hpp"
#include "rtpm/base/setup_error.hpp"

namespace rtpm::recording {

/// The remedy for a damaged recording.
inline constexpr const char* kRepair = "save what is whole: rtpm bag recover";

/// A record in the file.
struct RecordPlace {
  Opcode opcode{};
  std::uint64_t offset = 0;  ///< Offset of its opcode.
  std::uint64_t content_size = 0;
  [[nodiscard]] std::uint64_t content_offset() const noexcept { return offset + kRecordHeaderSize; }
  [[nodiscard]] std::uint64_t end() const noexcept { return content_offset() + content_size; }
};

/// The number of records or messages between two reports of progress.
inline constexpr std::uint64_t kProgressStep = 1024;

/// The error of a function that `progress` stopped.
[[nodiscard]] SetupError stopped(const std::string& what);

/// A regular file with random access. It may shrink while it is open: every read is checked.
/// @ownership owns the open file
class InputFile {
 public:
  /// @errors   no such file; a pipe, a device or a folder; not an MCAP file
  [[nodiscard]] static expected<InputFile, SetupError> open(const std::string& path);
  /// @errors   the file has fewer bytes; more than a chunk may have; a disk error
  [[nodiscard]] expected<std::vector<std::byte>, SetupError> read(std::uint64_t offset,
                                                                  std::uint64_t size) const;
  /// The record at `offset`. nullopt if it extends beyond the file, or has opcode 0, which the
  /// format does not define but which fills the holes of a file.
  [[nodiscard]] std::optional<RecordPlace> record_at(std::uint64_t offset) const;
  [[nodiscard]] expected<std::vector<std::byte>, SetupError> content(
      const RecordPlace& record) const;

  [[nodiscard]] std::uint64_t size() const noexcept { return size_; }
  [[nodiscard]] const std::string& path() const noexcept { return path_; }

 private:
  InputFile(std::string path, os::File file, std::uint64_t size) noexcept;

  std::string path_;
  os::File file_;
  std::uint64_t size_;
};

/// A chunk with its uncompressed records.
struct UnpackedChunk {
  std::uint64_t begin_ns = 0;  ///< Stated in the chunk.
  std::uint64_t end_ns = 0;
  std::vector<std::byte> records{};
};

/// @errors   an unknown compression, damage, a wrong checksum: in words with the place
[[nodiscard]] expected<UnpackedChunk, SetupError> unpack(const InputFile& file,
                                                         const RecordPlace& chunk);

/// Calls `visit(opcode, content, offset)` for each record in `records`, until it returns false.
/// @return whether all of them are complete
template <class Visit>
bool for_each_record(ConstBytes records, const Visit& visit) {
  std::uint64_t offset = 0;
  while (offset < records.size()) {
    ByteReader reader(records.subspan(offset));
    const auto opcode = static_cast<Opcode>(reader.take<std::uint8_t>());
    const ConstBytes content = reader.take_bytes(reader.take<std::uint64_t>());
    if (!reader.ok()) return false;
    if (!visit(opcode, content, offset)) return true;
    offset += kRecordHeaderSize + content.size();
  }
  return true;
}

/// Calls `visit(place)` for each complete record from the file's beginning to the end of its data,
/// inclusive, until it returns false.
/// @return the end of the last record
template <class Visit>
std::uint64_t for_each_record(const InputFile& file, const Visit& visit) {
  std::uint64_t offset = kMagicSize;
  while (const auto record = file.record_at(offset)) {
    offset = record->end();
    if (!visit(*record) || record->opcode == Opcode::kDataEnd) break;
  }
  return offset;
}

}  // namespace rtpm::recording
