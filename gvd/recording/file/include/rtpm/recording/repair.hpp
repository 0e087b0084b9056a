#pragma once

#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/recording/file_reader.hpp"

namespace rtpm::recording {

/// The result of recover().
struct Recovery {
  std::uint64_t message_count = 0;        ///< Messages in the new file.
  std::uint64_t damaged_chunk_count = 0;  ///< Damaged chunks, which were omitted.
  /// Bytes omitted: at the end of the old file, of incomplete records, or between records.
  std::uint64_t cut_byte_count = 0;
  /// Lost messages of damaged chunks, by topic, as counted by the chunks' indexes. If an index is
  /// damaged, too, the number is unknown.
  std::map<std::string, std::uint64_t> lost_counts{};
  std::uint64_t unknown_channel_count =
      0;  ///< Messages omitted because no intact record describes their channel.
  std::vector<std::string> untyped_topics{};  ///< Topics whose schema is in no intact record.

  /// Whether the new file contains everything of the old one.
  [[nodiscard]] bool is_without_loss() const noexcept {
    return damaged_chunk_count == 0 && cut_byte_count == 0 && unknown_channel_count == 0 &&
           untyped_topics.empty();
  }
};

/// The metadata that lists the losses of a recovered recording.
inline constexpr const char* kRecoveryMetadata = "rtpm.recovery";

/// Writes a new recording with everything that is intact in a truncated or damaged one, and with
/// the channels and schemas of its summary, if that is intact. After damage it continues at the
/// next record that the summary lists. The new file also lists the losses. It gets its name once
/// complete.
/// @errors   not an MCAP file; the new file exists, or cannot be written; it was stopped
/// @realtime never
[[nodiscard]] expected<Recovery, SetupError> recover(const std::string& from, const std::string& to,
                                                     const Progress& progress = {});

/// Writes a new recording of the messages that `query` selects, with their channels, the notes of
/// that time, and all metadata and attachments. It gets its name once complete.
/// capture::cut() makes a part that can be played.
/// @param first  of the old recording's channels; the new one begins with them
/// @return   the number of messages in the new recording
/// @errors   those of FileReader::open() and read(); the new file exists, or cannot be written; the
///           notes can't be read; it was stopped
/// @realtime never
[[nodiscard]] expected<std::uint64_t, SetupError> cut(const std::string& from,
                                                      const std::string& to, const Query& query,
                                                      std::span<const Message> first = {},
                                                      const Progress& progress = {});

/// Reads a whole recording and lists its errors, one clause each, at most 100; empty if there are
/// none.
/// @errors   no such file; not an MCAP file; stopped
/// @realtime never
[[nodiscard]] expected<std::vector<std::string>, SetupError> check(const std::string& path,
                                                                   const Progress& progress = {});

}  // namespace rtpm::recording
