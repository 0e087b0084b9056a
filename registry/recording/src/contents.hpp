#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <vector>

#include "input_file.hpp"
#include "rtpm/recording/file_reader.hpp"

namespace rtpm::recording {

/// Records that are read at once: a chunk, or consecutive ones outside of chunks.
struct Block {
  /// Bounds of the log times of its messages, as the index states them or as they were found.
  std::uint64_t begin_ns = 0;
  std::uint64_t end_ns = 0;
  RecordPlace chunk{};
  bool is_chunk = true;
  std::uint64_t begin = 0;  ///< If it is no chunk.
  std::uint64_t end = 0;
  /// In the file.
  [[nodiscard]] std::uint64_t place() const noexcept { return is_chunk ? chunk.offset : begin; }
};

/// The contents of a recording and their places, without its messages.
struct Contents {
  std::map<std::uint16_t, Schema> schemas{};
  std::map<std::uint16_t, Channel> channels{};
  Statistics statistics{};
  bool is_complete = false;
  std::vector<Block> blocks{};  ///< In the order of `begin_ns`.
  std::vector<RecordPlace> metadata{};
  std::vector<RecordPlace> attachments{};
};

/// "the recording … is damaged: `why`", with the remedy.
[[nodiscard]] unexpected<SetupError> damaged(const InputFile& file, const std::string& why);

/// Where the summary of a file is that its writer ended.
struct SummaryPlace {
  std::uint64_t begin = 0;
  std::uint64_t end = 0;  ///< As `begin`: there is none.
};
/// @return   nothing: it was not ended
/// @errors   a summary that is not in the file
[[nodiscard]] expected<std::optional<SummaryPlace>, SetupError> find_summary(const InputFile& file);

/// The bytes of a summary.
/// @errors   a wrong checksum
[[nodiscard]] expected<std::vector<std::byte>, SetupError> read_summary(const InputFile& file,
                                                                        const SummaryPlace& place);

/// Finds what is in a file: by its summary; what that lacks, in the chunks.
/// @errors   as FileReader::open()
[[nodiscard]] expected<Contents, SetupError> read_contents(const InputFile& file,
                                                           Incomplete incomplete,
                                                           const Progress& progress);

/// The uncompressed records of a block.
/// @errors   as unpack()
[[nodiscard]] expected<std::vector<std::byte>, SetupError> load(const InputFile& file,
                                                                const Block& block);

}  // namespace rtpm::recording
