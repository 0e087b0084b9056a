#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/recording/mcap.hpp"

namespace rtpm::recording {

/// Which messages FileReader::read() hands out.
struct Query {
  std::uint64_t from_ns = 0;  ///< Log time, inclusive.
  std::uint64_t to_ns = UINT64_MAX;
  std::vector<std::uint16_t> channel_ids{};  ///< Empty: all.
};

/// What open() does with a file that has no summary, because its writer died.
enum class Incomplete : std::uint8_t { kRefuse, kRead };

/// Reads a recording of any MCAP writer: through its summary, or where that is missing by one pass
/// over the file. Bytes are untrusted: each size, offset and checksum is checked.
/// @ownership owns the file
/// @threads  one at a time
/// @realtime never
class FileReader {
 public:
  /// Uncompressed bytes of a chunk; a larger one is refused.
  static constexpr std::uint64_t kChunkByteMax = std::uint64_t{1} << 28;

  /// @errors   in words: no such file; no MCAP file; it was not ended and kRefuse; a damaged
  /// summary
  [[nodiscard]] static expected<std::unique_ptr<FileReader>, SetupError> open(
      const std::string& path, Incomplete incomplete = Incomplete::kRefuse);
  FileReader(const FileReader&) = delete;
  FileReader& operator=(const FileReader&) = delete;
  ~FileReader();

  /// By number.
  [[nodiscard]] const std::map<std::uint16_t, Schema>& schemas() const noexcept;
  [[nodiscard]] const std::map<std::uint16_t, Channel>& channels() const noexcept;
  [[nodiscard]] const Statistics& statistics() const noexcept;
  /// Whether its writer ended it.
  [[nodiscard]] bool is_complete() const noexcept;

  /// Calls `visit` for each message in the order of log times, those of one time in the order in
  /// which they were written, until it returns false. A message's bytes live until `visit` returns.
  /// @errors   a damaged chunk, in words with its place; the messages before it were visited
  [[nodiscard]] expected<void, SetupError> read(const Query& query,
                                                const std::function<bool(const Message&)>& visit);
  /// @errors   a damaged one
  [[nodiscard]] expected<std::vector<Metadata>, SetupError> read_metadata();
  [[nodiscard]] expected<std::vector<Attachment>, SetupError> read_attachments();

 private:
  struct Impl;
  explicit FileReader(std::unique_ptr<Impl> impl) noexcept;
  std::unique_ptr<Impl> impl_;
};

}  // namespace rtpm::recording
