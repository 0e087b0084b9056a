#pragma once

#include <memory>
#include <string>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/recording/mcap.hpp"

namespace rtpm::recording {

/// Settings for FileWriter::create().
struct WriterConfig {
  Compression compression = Compression::kZstd;
  std::size_t chunk_byte_max = 1 << 20;  ///< Uncompressed; a larger message gets its own chunk.
  std::string profile{};                 ///< "rtpm"; empty: none.
};

/// Writes a recording: messages in compressed, indexed chunks, and at the end a summary. Each chunk
/// is in the file when it is full or end_chunk() is called, so a program that dies loses at most
/// one.
/// @ownership owns the file
/// @threads  one at a time
/// @realtime never: compresses and writes
class FileWriter {
 public:
  /// Creates the file.
  /// @errors   in words: it exists already, no such folder, no right
  [[nodiscard]] static expected<std::unique_ptr<FileWriter>, SetupError> create(
      const std::string& path, WriterConfig config = {});
  FileWriter(const FileWriter&) = delete;
  FileWriter& operator=(const FileWriter&) = delete;
  /// Closes.
  ~FileWriter();

  /// Gives a schema a number, from 1; an equal one keeps its own.
  /// @errors   more than 65535 of them
  [[nodiscard]] expected<std::uint16_t, SetupError> add_schema(const Schema& schema);
  /// Gives a channel a number, from 1; an equal one keeps its own.
  /// @errors   more than 65535 of them; a schema that was not added
  [[nodiscard]] expected<std::uint16_t, SetupError> add_channel(const Channel& channel);

  /// @errors   a channel that was not added; the disk is full, or another error of the file: what
  ///           was written until then stays readable, and all further calls fail likewise
  [[nodiscard]] expected<void, SetupError> write(const Message& message);
  [[nodiscard]] expected<void, SetupError> write(const Attachment& attachment);
  [[nodiscard]] expected<void, SetupError> write(const Metadata& metadata);
  /// Puts into the file what was written. Call it once per second, so that no more is lost.
  [[nodiscard]] expected<void, SetupError> end_chunk();
  /// Writes the summary and closes the file. No other call may follow.
  [[nodiscard]] expected<void, SetupError> close();

  [[nodiscard]] const Statistics& statistics() const noexcept;
  /// Bytes in the file.
  [[nodiscard]] std::uint64_t size() const noexcept;

 private:
  struct Impl;
  explicit FileWriter(std::unique_ptr<Impl> impl) noexcept;
  std::unique_ptr<Impl> impl_;
};

}  // namespace rtpm::recording
