#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/recording/mcap.hpp"

namespace rtpm::recording {

// A recording may come from anywhere. One that demands more than these of its reader is refused in
// words.
/// Bytes of a chunk, uncompressed, and of any record that is read at once.
inline constexpr std::uint64_t kChunkByteMax = std::uint64_t{1} << 28;
/// Chunks, pieces of the file outside of chunks, metadata and attachments, of each.
inline constexpr std::size_t kPlaceCountMax = std::size_t{1} << 20;
/// Bytes of all schemas and channels; of all metadata.
inline constexpr std::uint64_t kDescriptionByteMax = std::uint64_t{1} << 26;
/// Bytes of chunks that overlap in time and are therefore held together; of all attachments.
inline constexpr std::uint64_t kHeldByteMax = std::uint64_t{1} << 29;

/// Is told at times how many of how many bytes, chunks, or nanoseconds of log time are done.
/// Returns false to stop; then no new file is left. Between two calls lies the work on one chunk.
using Progress = std::function<bool(std::uint64_t done, std::uint64_t whole)>;

/// Which messages FileReader::read() hands out.
struct Query {
  std::uint64_t from_ns = 0;  ///< Log time, inclusive.
  std::uint64_t to_ns = UINT64_MAX;
  std::vector<std::uint16_t> channel_ids{};  ///< Empty: all.
};

/// What open() does with a file that has no summary, because its writer died.
enum class Incomplete : std::uint8_t { kRefuse, kRead };

/// The summary at the end of a recording, read without its chunks.
struct Outline {
  bool is_complete = false;                ///< Whether its writer ended it.
  std::optional<Statistics> statistics{};  ///< None: it states none.
};

/// Reads the outline of a recording, however large that is.
/// @errors   no such file; no regular file; no MCAP file
/// @realtime never
[[nodiscard]] expected<Outline, SetupError> read_outline(const std::string& path);

/// Reads a recording of any MCAP writer: through its summary, what that does not repeat from the
/// chunks, and without a summary by one pass over the file. Bytes are untrusted: each size, offset
/// and checksum is checked, and so are the times by which chunks are ordered.
/// @ownership owns the file
/// @threads  one at a time
/// @realtime never
class FileReader {
 public:
  /// @errors   in words: no such file; no regular file; no MCAP file; it was not ended and kRefuse;
  ///           a damaged summary; above a limit; it was stopped
  [[nodiscard]] static expected<std::unique_ptr<FileReader>, SetupError> open(
      const std::string& path, Incomplete incomplete = Incomplete::kRefuse,
      const Progress& progress = {});
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
  /// @errors   a damaged chunk, in words with its place; a chunk whose messages are outside of the
  ///           times that it states, where that matters; above a limit; it was stopped. The
  ///           messages before it were visited
  [[nodiscard]] expected<void, SetupError> read(const Query& query,
                                                const std::function<bool(const Message&)>& visit,
                                                const Progress& progress = {});
  /// @errors   a damaged one; above a limit
  [[nodiscard]] expected<std::vector<Metadata>, SetupError> read_metadata();
  [[nodiscard]] expected<std::vector<Attachment>, SetupError> read_attachments();

 private:
  struct Impl;
  explicit FileReader(std::unique_ptr<Impl> impl) noexcept;
  std::unique_ptr<Impl> impl_;
};

}  // namespace rtpm::recording
