#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <vector>

#include "input_file.hpp"
#include "rtpm/recording/file_reader.hpp"

namespace rtpm::recording {

/// Records that are read together: a chunk, or consecutive records outside chunks.
struct Block {
  /// The range of the messages' log times, from the index or the messages.
  std::uint64_t begin_ns = 0;
  std::uint64_t end_ns = 0;
  RecordPlace chunk{};
  bool is_chunk = true;
  std::uint64_t begin = 0;  ///< Offset of records outside chunks.
  std::uint64_t end = 0;
  /// The channels that the chunk's index names: a part of Contents::indexed_channels.
  std::size_t first_channel = 0;
  std::size_t channel_count = 0;  ///< 0 if no index tells the channels.
  /// Offset in the file.
  [[nodiscard]] std::uint64_t place() const noexcept { return is_chunk ? chunk.offset : begin; }
};

/// The contents of a recording and their positions, without its messages.
struct Contents {
  std::map<std::uint16_t, Schema> schemas{};
  std::map<std::uint16_t, Channel> channels{};
  Statistics statistics{};
  bool is_complete = false;
  std::vector<Block> blocks{};  ///< Ordered by `begin_ns`.
  std::vector<std::uint16_t> indexed_channels{};
  std::vector<RecordPlace> metadata{};
  std::vector<RecordPlace> attachments{};
};

/// The error "the recording … is damaged: `why`", with the remedy.
[[nodiscard]] unexpected<SetupError> damaged(const InputFile& file, const std::string& why);

/// The position of the summary in a complete file.
struct SummaryPlace {
  std::uint64_t begin = 0;
  std::uint64_t end = 0;  ///< Equal to `begin` if there is no summary.
};
/// @return   nullopt if the file is incomplete
/// @errors   the summary is not within the file
[[nodiscard]] expected<std::optional<SummaryPlace>, SetupError> find_summary(const InputFile& file);

/// The bytes of a summary.
/// @errors   a wrong checksum
[[nodiscard]] expected<std::vector<std::byte>, SetupError> read_summary(const InputFile& file,
                                                                        const SummaryPlace& place);

/// Finds the contents of a file: from its summary or, if that is incomplete, from the chunks.
/// @errors   those of FileReader::open()
[[nodiscard]] expected<Contents, SetupError> read_contents(const InputFile& file,
                                                           Incomplete incomplete,
                                                           const Progress& progress);

/// The uncompressed records of a block.
/// @errors   those of unpack()
[[nodiscard]] expected<std::vector<std::byte>, SetupError> load(const InputFile& file,
                                                                const Block& block);

}  // namespace rtpm::recording
