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

// Limits, as a recording may come from an untrusted source. A recording that exceeds one is refused
// with an error.
/// Bytes of an uncompressed chunk, and of any record that is read as a whole.
inline constexpr std::uint64_t kChunkByteMax = std::uint64_t{1} << 28;
/// The number of chunks, of pieces of the file outside chunks, of metadata, and of attachments.
inline constexpr std::size_t kPlaceCountMax = std::size_t{1} << 20;
/// Bytes of all schemas and channels; separately, of all metadata.
inline constexpr std::uint64_t kDescriptionByteMax = std::uint64_t{1} << 26;
/// Bytes of chunks that overlap in time, and are therefore in memory together; separately, of all
/// attachments.
inline constexpr std::uint64_t kHeldByteMax = std::uint64_t{1} << 29;

/// Called occasionally with the progress: bytes, chunks, or nanoseconds of log time, done and
/// total. Returns false to stop; then no new file remains. At most one chunk is processed between
/// two calls.
using Progress = std::function<bool(std::uint64_t done, std::uint64_t whole)>;

/// Selects the messages that FileReader::read() visits.
struct Query {
  std::uint64_t from_ns = 0;  ///< Log time, inclusive.
  std::uint64_t to_ns = UINT64_MAX;
  std::vector<std::uint16_t> channel_ids{};  ///< If empty, all channels.
};

/// How open() handles a file that has no summary, because its writer died.
enum class Incomplete : std::uint8_t { kRefuse, kRead };

/// The summary at the end of a recording, read without its chunks.
struct Outline {
  bool is_complete = false;                ///< Whether the writer completed the file.
  std::optional<Statistics> statistics{};  ///< nullopt if the file states none.
};

/// Reads the outline of a recording, in a time that does not depend on its size.
/// @errors   no such file; not a regular file; not an MCAP file
/// @realtime never
[[nodiscard]] expected<Outline, SetupError> read_outline(const std::string& path);

/// Reads a recording of any MCAP writer: through its summary, from the chunks if the summary does
/// not repeat their contents, and without a summary by one pass over the file. Bytes are untrusted:
/// every size, offset and checksum is checked, and so are the times that order the chunks.
/// @ownership owns the file
/// @threads  one at a time
/// @realtime never
class FileReader {
 public:
  /// @errors   described in words: no such file; not a regular file; not an MCAP file; it is
  ///           incomplete and kRefuse; a damaged summary; above a limit; stopped
  [[nodiscard]] static expected<std::unique_ptr<FileReader>, SetupError> open(
      const std::string& path, Incomplete incomplete = Incomplete::kRefuse,
      const Progress& progress = {});
  FileReader(const FileReader&) = delete;
  FileReader& operator=(const FileReader&) = delete;
  ~FileReader();

  /// The schemas, keyed by number.
  [[nodiscard]] const std::map<std::uint16_t, Schema>& schemas() const noexcept;
  [[nodiscard]] const std::map<std::uint16_t, Channel>& channels() const noexcept;
  [[nodiscard]] const Statistics& statistics() const noexcept;
  /// Whether the writer completed the file.
  [[nodiscard]] bool is_complete() const noexcept;

  /// Calls `visit` for each message in order of log time, or of writing if these are equal, until
  /// it returns false. A message's bytes are valid until `visit` returns.
  /// @errors   a damaged chunk, in words with its position; a chunk with messages outside its
  ///           stated times, if that matters; above a limit; stopped. Earlier messages have been
  ///           visited
  [[nodiscard]] expected<void, SetupError> read(const Query& query,
                                                const std::function<bool(const Message&)>& visit,
                                                const Progress& progress = {});
  /// @errors   a damaged attachment; above a limit
  [[nodiscard]] expected<std::vector<Metadata>, SetupError> read_metadata();
  [[nodiscard]] expected<std::vector<Attachment>, SetupError> read_attachments();

 private:
  struct Impl;
  explicit FileReader(std::unique_ptr<Impl> impl) noexcept;
  std::unique_ptr<Impl> impl_;
};

}  // namespace rtpm::recording
