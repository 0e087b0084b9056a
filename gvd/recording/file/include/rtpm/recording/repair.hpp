#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/recording/file_reader.hpp"

namespace rtpm::recording {

/// The result of recover().
struct Recovery {
  std::uint64_t message_count = 0;        ///< Messages in the new file.
  std::uint64_t damaged_chunk_count = 0;  ///< Damaged chunks, which were left out.
  /// Bytes left out: at the end of the old file, of an incomplete record, or between records.
  std::uint64_t cut_byte_count = 0;
  /// Messages of damaged chunks, by topic, as their indexes count them; if these are damaged, too,
  /// the number is unknown.
  std::map<std::string, std::uint64_t> lost_counts{};
  std::uint64_t unknown_channel_count =
      0;  ///< Messages left out: no whole record has their channel.
  std::vector<std::string> untyped_topics{};  ///< Topics whose schema is in no whole record.

  /// Whether the new file has everything that the old one had.
  [[nodiscard]] bool is_without_loss() const noexcept {
    return damaged_chunk_count == 0 && cut_byte_count == 0 && unknown_channel_count == 0 &&
           untyped_topics.empty();
  }
};

/// The metadata in which a recovered recording lists what it lost.
inline constexpr const char* kRecoveryMetadata = "rtpm.recovery";

/// Writes a new recording of everything that is intact in a truncated or damaged one, with the
/// channels and schemas of its summary, if that is intact. After a damaged place it continues at
/// the next record that the summary knows. The new file also lists what was lost. It gets its name
/// when it is complete.
/// @errors   not an MCAP file; the new file exists, or cannot be written; it was stopped
/// @realtime never
[[nodiscard]] expected<Recovery, SetupError> recover(const std::string& from, const std::string& to,
                                                     const Progress& progress = {});

/// Writes a new recording of the messages that `query` selects, with their channels, and all
/// metadata and attachments. It gets its name when it is complete.
/// @return   the number of messages that it has
/// @errors   as FileReader::open() and read(); the new file exists, or cannot be written; it was
///           stopped
/// @realtime never
[[nodiscard]] expected<std::uint64_t, SetupError> cut(const std::string& from,
                                                      const std::string& to, const Query& query,
                                                      const Progress& progress = {});

/// Reads all of a recording and lists its errors, a clause each, at most 100; empty if it has none.
/// @errors   no such file; no MCAP file; it was stopped
/// @realtime never
[[nodiscard]] expected<std::vector<std::string>, SetupError> check(const std::string& path,
                                                                   const Progress& progress = {});

}  // namespace rtpm::recording
