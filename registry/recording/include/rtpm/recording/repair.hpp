#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/recording/file_reader.hpp"

namespace rtpm::recording {

/// Is told at times how many of how many bytes, or nanoseconds of log time, are done. Returns false
/// to stop; then no new file is left.
using Progress = std::function<bool(std::uint64_t done, std::uint64_t whole)>;

/// What recover() did.
struct Recovery {
  std::uint64_t message_count = 0;        ///< In the new file.
  std::uint64_t damaged_chunk_count = 0;  ///< Left out.
  std::uint64_t cut_byte_count =
      0;  ///< At the end of the old file, of a record that was not whole.
};

/// Writes a new recording of all that is whole in a truncated or damaged one. It has its name when
/// it is whole.
/// @errors   no MCAP file; the new file exists, or can't be written; it was stopped
/// @realtime never
[[nodiscard]] expected<Recovery, SetupError> recover(const std::string& from, const std::string& to,
                                                     const Progress& progress = {});

/// Writes a new recording of the messages that `query` names, with their channels, and all metadata
/// and attachments. It has its name when it is whole.
/// @return   how many messages it has
/// @errors   as FileReader::open() and read(); the new file exists, or can't be written; it was
///           stopped
/// @realtime never
[[nodiscard]] expected<std::uint64_t, SetupError> cut(const std::string& from,
                                                      const std::string& to, const Query& query,
                                                      const Progress& progress = {});

/// Reads all of a recording and says what is wrong with it, a clause each; empty: nothing.
/// @errors   no such file; no MCAP file; it was stopped
/// @realtime never
[[nodiscard]] expected<std::vector<std::string>, SetupError> check(const std::string& path,
                                                                   const Progress& progress = {});

}  // namespace rtpm::recording
