#include "input_file.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <utility>

#include "compression.hpp"
#include "rtpm/recording/file_reader.hpp"

namespace rtpm::recording {

expected<InputFile, SetupError> InputFile::open(const std::string& path) {
  const auto refuse = [&](std::error_code cause) {
    return setup_error("the recording " + path + " can't be read", cause, "name a recording");
  };
  const int descriptor = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (descriptor < 0) return refuse(system_error(errno));
  struct stat status {};
  const bool is_known = ::fstat(descriptor, &status) == 0;
  InputFile file(path, descriptor, is_known ? static_cast<std::uint64_t>(status.st_size) : 0);
  if (!is_known) return refuse(system_error(errno));
  if (!S_ISREG(status.st_mode)) return refuse(system_error(EINVAL));
  const auto magic = file.read(0, std::min<std::uint64_t>(file.size_, kMagicSize));
  if (!magic || !std::ranges::equal(*magic, std::as_bytes(std::span(kMagic)))) {
    return setup_error(path + " is no recording", "it does not begin as an MCAP file",
                       "name a file that was recorded");
  }
  return file;
}

InputFile::InputFile(std::string path, int descriptor, std::uint64_t size) noexcept
    : path_(std::move(path)), descriptor_(descriptor), size_(size) {}

InputFile::InputFile(InputFile&& other) noexcept
    : path_(std::move(other.path_)),
      descriptor_(std::exchange(other.descriptor_, -1)),
      size_(other.size_) {}

InputFile::~InputFile() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

expected<std::vector<std::byte>, SetupError> InputFile::read(std::uint64_t offset,
                                                             std::uint64_t size) const {
  const auto fail = [&](const std::string& why) {
    return setup_error(
        "the recording " + path_ + " can't be read at byte " + std::to_string(offset), why,
        kRepair);
  };
  if (offset > size_ || size > size_ - offset) return fail("it ends before");
  std::vector<std::byte> bytes(size);
  std::size_t done = 0;
  while (done < size) {
    const ssize_t count =
        ::pread(descriptor_, bytes.data() + done, size - done, static_cast<off_t>(offset + done));
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) return fail(system_error(errno).message());
    if (count == 0) return fail("it has become shorter");
    done += static_cast<std::size_t>(count);
  }
  return bytes;
}

std::optional<RecordPlace> InputFile::record_at(std::uint64_t offset) const {
  const auto head = read(offset, kRecordHeaderSize);
  if (!head) return std::nullopt;
  ByteReader reader(*head);
  RecordPlace place;
  place.opcode = static_cast<Opcode>(reader.take<std::uint8_t>());
  place.offset = offset;
  place.content_size = reader.take<std::uint64_t>();
  if (place.content_size > size_ - place.content_offset()) return std::nullopt;
  return place;
}

expected<std::vector<std::byte>, SetupError> InputFile::content(const RecordPlace& record) const {
  return read(record.content_offset(), record.content_size);
}

expected<std::vector<std::byte>, SetupError> unpack(const InputFile& file,
                                                    const RecordPlace& chunk) {
  const auto damaged = [&](const std::string& why) {
    return setup_error(
        "the chunk at byte " + std::to_string(chunk.offset) + " of " + file.path() + " is damaged",
        why, kRepair);
  };
  const auto content = file.content(chunk);
  if (!content) return unexpected{content.error()};
  const auto head = parse_chunk(*content);
  if (!head) return damaged("its head is cut short");
  if (head->uncompressed_size > FileReader::kChunkByteMax) return damaged("it is above 256 MiB");
  auto records = decompress(head->compression, head->records, head->uncompressed_size);
  if (!records) return damaged("it can't be decompressed");
  if (head->uncompressed_crc != 0 && crc32(*records) != head->uncompressed_crc) {
    return damaged("its checksum is wrong");
  }
  return std::move(*records);
}

}  // namespace rtpm::recording
