#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "rtpm/base/setup_error.hpp"

namespace rtpm::recording {

/// What recover() did.
struct Recovery {
  std::uint64_t message_count = 0;        ///< In the new file.
  std::uint64_t damaged_chunk_count = 0;  ///< Left out.
  std::uint64_t cut_byte_count =
      0;  ///< At the end of the old file, of a record that was not whole.
};

/// Writes a new recording of all that is whole in a truncated or damaged one.
/// @errors   no MCAP file; the new file can't be written
/// @realtime never
[[nodiscard]] expected<Recovery, SetupError> recover(const std::string& from,
                                                     const std::string& to);

/// Reads all of a recording and says what is wrong with it, a clause each; empty: nothing.
/// @errors   no such file; no MCAP file
/// @realtime never
[[nodiscard]] expected<std::vector<std::string>, SetupError> check(const std::string& path);

}  // namespace rtpm::recording
