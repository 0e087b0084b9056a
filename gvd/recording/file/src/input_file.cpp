#include "input_file.hpp"

#include <algorithm>
#include <utility>

#include "compression.hpp"
#include "rtpm/recording/file_reader.hpp"

namespace rtpm::recording {
namespace {

/// Fits a chunk that compression did not shrink, with its header.
constexpr std::uint64_t kReadByteMax = kChunkByteMax + (1 << 16);

}  // namespace

SetupError stopped(const std::string& what) {
  return {what + " is not done", "it was stopped"};
}

expected<InputFile, SetupError> InputFile::open(const std::string& path) {
  auto opened = os::open_input(path);
  if (!opened) {
    return setup_error("the recording " + path + " can't be read", opened.error(),
                       "name a recording");
  }
  if (!opened->file.is_open()) {
    return setup_error("the recording " + path + " can't be read",
                       "it is a pipe, a device or a folder", "name a recording");
  }
  InputFile file(path, std::move(opened->file), opened->size);
  const auto magic = file.read(0, std::min<std::uint64_t>(file.size_, kMagicSize));
  if (!magic || !std::ranges::equal(*magic, std::as_bytes(std::span(kMagic)))) {
    return setup_error(path + " is no recording", "it does not begin as an MCAP file",
                       "name a file that was recorded");
  }
  return file;
}

InputFile::InputFile(std::string path, os::File file, std::uint64_t size) noexcept
    : path_(std::move(path)), file_(std::move(file)), size_(size) {}

expected<std::vector<std::byte>, SetupError> InputFile::read(std::uint64_t offset,
                                                             std::uint64_t size) const {
  const auto fail = [&](const std::string& why) {
    return setup_error(
        "the recording " + path_ + " can't be read at byte " + std::to_string(offset), why,
        kRepair);
  };
  if (offset > size_ || size > size_ - offset) return fail("it ends before");
  if (size > kReadByteMax) return fail("a part of it is above 256 MiB");
  std::vector<std::byte> bytes(size);
  std::size_t done = 0;
  while (done < size) {
    const auto count = os::read_at(file_, offset + done, MutableBytes(bytes).subspan(done));
    if (!count) return fail(count.error().message());
    if (*count == 0) return fail("it has become shorter");
    done += *count;
  }
  return bytes;
}

std::optional<RecordPlace> InputFile::record_at(std::uint64_t offset) const {
  if (offset > size_ || size_ - offset < kRecordHeaderSize) return std::nullopt;
  const auto head = read(offset, kRecordHeaderSize);
  if (!head) return std::nullopt;
  ByteReader reader(*head);
  RecordPlace place;
  place.opcode = static_cast<Opcode>(reader.take<std::uint8_t>());
  place.offset = offset;
  place.content_size = reader.take<std::uint64_t>();
  if (place.opcode == Opcode{0}) return std::nullopt;
  if (place.content_size > size_ - place.content_offset()) return std::nullopt;
  return place;
}

expected<std::vector<std::byte>, SetupError> InputFile::content(const RecordPlace& record) const {
  return read(record.content_offset(), record.content_size);
}

expected<UnpackedChunk, SetupError> unpack(const InputFile& file, const RecordPlace& chunk) {
  const auto damaged = [&](const std::string& why) {
    return setup_error(
        "the chunk at byte " + std::to_string(chunk.offset) + " of " + file.path() + " is damaged",
        why, kRepair);
  };
  if (chunk.content_size > kReadByteMax) return damaged("it is above 256 MiB");
  const auto content = file.content(chunk);
  if (!content) return unexpected{content.error()};
  const auto head = parse<ChunkHead>(*content);
  if (!head) return damaged("its head is cut short");
  if (head->uncompressed_size > kChunkByteMax) return damaged("it is above 256 MiB");
  auto records = decompress(head->compression, head->records, head->uncompressed_size);
  if (!records) return damaged("it can't be decompressed");
  if (head->uncompressed_crc != 0 && crc32(*records) != head->uncompressed_crc) {
    return damaged("its checksum is wrong");
  }
  return UnpackedChunk{head->begin_ns, head->end_ns, std::move(*records)};
}

}  // namespace rtpm::recording
