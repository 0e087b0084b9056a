#include "rtpm/exports/zip.hpp"

#include <zlib.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <limits>
#include <memory>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include "os/file.hpp"
#include "rtpm/base/printable.hpp"

namespace rtpm::exports {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kBlockSize = std::size_t{1} << 18;
constexpr std::uint16_t kVersion = 45;  // The first one with ZIP64.
constexpr std::uint16_t kUtf8Flag = 1 << 11;
constexpr std::uint16_t kDeflated = 8;
constexpr std::uint32_t kInExtra = 0xffffffff;
/// 1 January 1980: files have no times, so that equal tables are equal files.
constexpr std::uint16_t kDate = (1 << 5) | 1;

struct Close {
  void operator()(std::FILE* file) const noexcept { static_cast<void>(std::fclose(file)); }
};
using File = std::unique_ptr<std::FILE, Close>;

struct Entry {
  std::string name{};
  std::uint64_t at = 0;  ///< The position of its local header.
  std::uint64_t size = 0;
  std::uint64_t packed_size = 0;
  std::uint32_t checksum = 0;
};

/// Appends little-endian numbers.
class Record {
 public:
  Record& u16(std::uint64_t value) { return number(value, 2); }
  Record& u32(std::uint64_t value) { return number(value, 4); }
  Record& u64(std::uint64_t value) { return number(value, 8); }
  Record& text(std::string_view value) {
    bytes_ += value;
    return *this;
  }
  [[nodiscard]] const std::string& bytes() const noexcept { return bytes_; }

 private:
  Record& number(std::uint64_t value, int size) {
    for (int i = 0; i < size; ++i)
      bytes_ += static_cast<char>(value >> (8 * i) & 0xff);
    return *this;
  }
  std::string bytes_{};
};

/// Both sizes are in the extra field, so that it is known before the data how long the header is.
Record local_header(const Entry& entry) {
  Record record;
  record.u32(0x04034b50).u16(kVersion).u16(kUtf8Flag).u16(kDeflated).u16(0).u16(kDate);
  record.u32(entry.checksum).u32(kInExtra).u32(kInExtra).u16(entry.name.size()).u16(20);
  return record.text(entry.name).u16(1).u16(16).u64(entry.size).u64(entry.packed_size);
}

Record central_header(const Entry& entry) {
  Record record;
  record.u32(0x02014b50).u16(kVersion).u16(kVersion).u16(kUtf8Flag).u16(kDeflated).u16(0);
  record.u16(kDate).u32(entry.checksum).u32(kInExtra).u32(kInExtra).u16(entry.name.size());
  record.u16(28).u16(0).u16(0).u16(0).u32(0).u32(kInExtra).text(entry.name);
  return record.u16(1).u16(24).u64(entry.size).u64(entry.packed_size).u64(entry.at);
}

struct DeflateEnd {
  void operator()(z_stream* stream) const noexcept {
    static_cast<void>(deflateEnd(stream));
    delete stream;
  }
};

class Zip {
 public:
  Zip(std::string path, File file, const recording::Progress& progress)
      : path_(std::move(path)), file_(std::move(file)), progress_(progress) {}

  expected<void, SetupError> add(const fs::path& source, std::string name) {
    const File input(os::open(source));
    if (!input) return setup_error(what(), system_error(errno));
    Entry entry{.name = std::move(name), .at = size_};
    if (auto put = write(local_header(entry).bytes()); !put) return put;
    if (auto packed = pack(input.get(), entry); !packed) return packed;
    // The header again, with what is known now.
    const bool is_back = os::seek(file_.get(), entry.at) &&
                         std::fwrite(local_header(entry).bytes().data(),
                                     local_header(entry).bytes().size(), 1, file_.get()) == 1 &&
                         os::seek_end(file_.get());
    entries_.push_back(std::move(entry));
    return is_back ? expected<void, SetupError>{} : setup_error(what(), system_error(errno));
  }

  expected<void, SetupError> finish() {
    const std::uint64_t at = size_;
    for (const Entry& entry : entries_) {
      if (auto put = write(central_header(entry).bytes()); !put) return put;
    }
    const std::uint64_t end_at = size_;
    const std::uint64_t count = entries_.size();
    Record end;
    end.u32(0x06064b50).u64(44).u16(kVersion).u16(kVersion).u32(0).u32(0).u64(count).u64(count);
    end.u64(end_at - at).u64(at);
    end.u32(0x07064b50).u32(0).u64(end_at).u32(1);
    end.u32(0x06054b50).u16(0).u16(0).u16(0xffff).u16(0xffff).u32(kInExtra).u32(kInExtra).u16(0);
    if (auto put = write(end.bytes()); !put) return put;
    if (std::fclose(file_.release()) != 0) return setup_error(what(), system_error(errno));
    return {};
  }

  void expect(std::uint64_t byte_count) { whole_ += byte_count; }

 private:
  [[nodiscard]] std::string what() const { return "'" + printable(path_) + "' can't be written"; }

  expected<void, SetupError> write(std::string_view bytes) {
    size_ += bytes.size();
    if (bytes.empty() || std::fwrite(bytes.data(), bytes.size(), 1, file_.get()) == 1) return {};
    return setup_error(what(), system_error(errno));
  }

  expected<void, SetupError> pack(std::FILE* input, Entry& entry) {
    std::unique_ptr<z_stream, DeflateEnd> stream(new z_stream{});
    // Negative: without zlib's own header.
    if (deflateInit2(stream.get(), Z_BEST_SPEED, Z_DEFLATED, -MAX_WBITS, 8, Z_DEFAULT_STRATEGY) !=
        Z_OK) {
      return setup_error(what(), "there is no memory");
    }
    std::vector<Bytef> plain(kBlockSize);
    std::vector<Bytef> packed(kBlockSize);
    entry.checksum = static_cast<std::uint32_t>(crc32(0, nullptr, 0));
    for (bool is_last = false; !is_last;) {
      const std::size_t count = std::fread(plain.data(), 1, plain.size(), input);
      if (std::ferror(input) != 0) return setup_error(what(), system_error(errno));
      is_last = count < plain.size();
      entry.size += count;
      done_ += count;
      if (progress_ && !progress_(std::min(done_, whole_), whole_))
        return setup_error(what(), "it was stopped");
      entry.checksum =
          static_cast<std::uint32_t>(crc32(entry.checksum, plain.data(), static_cast<uInt>(count)));
      stream->next_in = plain.data();
      stream->avail_in = static_cast<uInt>(count);
      do {
        stream->next_out = packed.data();
        stream->avail_out = static_cast<uInt>(packed.size());
        static_cast<void>(deflate(stream.get(), is_last ? Z_FINISH : Z_NO_FLUSH));
        const std::size_t size = packed.size() - stream->avail_out;
        entry.packed_size += size;
        if (auto put = write({reinterpret_cast<const char*>(packed.data()), size}); !put)
          return put;
      } while (stream->avail_out == 0);
    }
    return {};
  }

  std::string path_;
  File file_;
  const recording::Progress& progress_;
  std::vector<Entry> entries_{};
  std::uint64_t size_ = 0;
  std::uint64_t done_ = 0;
  std::uint64_t whole_ = 0;
};

expected<void, SetupError> fill(Zip& zip, const fs::path& folder) {
  std::error_code cause;
  std::vector<fs::path> files;
  for (fs::recursive_directory_iterator next(folder, cause), end; !cause && next != end;
       next.increment(cause)) {
    if (next->is_regular_file(cause)) files.push_back(next->path());
  }
  if (!cause) {
    for (const fs::path& file : files)
      zip.expect(fs::file_size(file, cause));
  }
  if (cause) return setup_error("'" + printable(folder.string()) + "' can't be read", cause);
  std::ranges::sort(files);
  for (const fs::path& file : files) {
    if (auto added = zip.add(file, fs::relative(file, folder, cause).generic_string()); !added)
      return added;
    fs::remove(file, cause);
  }
  return zip.finish();
}

}  // namespace

expected<void, SetupError> zip_folder(const std::string& folder, const std::string& path,
                                      const recording::Progress& progress) {
  File file(os::create(path));
  if (!file) return setup_error("'" + printable(path) + "' can't be written", system_error(errno));
  Zip zip(path, std::move(file), progress);
  auto filled = fill(zip, folder);
  std::error_code ignored;
  if (!filled) fs::remove(path, ignored);
  return filled;
}

}  // namespace rtpm::exports
