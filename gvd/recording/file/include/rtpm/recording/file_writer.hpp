#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <utility>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/recording/mcap.hpp"

namespace rtpm::recording {

/// Settings for FileWriter::create().
struct WriterConfig {
  Compression compression = Compression::kZstd;
  std::size_t chunk_byte_max = 1 << 20;  ///< Uncompressed; a larger message has its own chunk.
  std::string profile{};                 ///< "rtpm"; empty if none.
};

/// Writes a recording: messages in compressed, indexed chunks, and a summary at the end. A chunk is
/// written when it is full or end_chunk() is called, so a program that dies loses at most one
/// chunk.
/// @ownership owns the file
/// @threads  one at a time
/// @realtime never: compresses and writes
class FileWriter {
 public:
  /// Creates the file.
  /// @errors   described in words: the file exists, no such folder, no permission
  [[nodiscard]] static expected<std::unique_ptr<FileWriter>, SetupError> create(
      const std::string& path, WriterConfig config = {});
  FileWriter(const FileWriter&) = delete;
  FileWriter& operator=(const FileWriter&) = delete;
  /// Closes the file.
  ~FileWriter();

  /// Returns the schema's number, from 1; reuses it for an equal schema.
  /// @errors   more than 65535 schemas
  [[nodiscard]] expected<std::uint16_t, SetupError> add_schema(const Schema& schema);
  /// Returns the channel's number, from 1; reuses it for an equal channel.
  /// @errors   more than 65535 channels; a schema that was not added
  [[nodiscard]] expected<std::uint16_t, SetupError> add_channel(const Channel& channel);

  /// @errors   an unknown channel; the disk is full, or another error of the file: then the data
  ///           written so far stays readable, and all further calls fail, too
  [[nodiscard]] expected<void, SetupError> write(const Message& message);
  [[nodiscard]] expected<void, SetupError> write(const Attachment& attachment);
  [[nodiscard]] expected<void, SetupError> write(const Metadata& metadata);
  /// Ends the chunk, so that all messages reach the file. Call it once per second to bound losses.
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

/// The treatment of an existing file.
enum class Existing : std::uint8_t {
  kRefuse,
  kReplace,  ///< Replaced once the new file is complete.
};

/// A new recording that has a temporary name until it is complete.
/// @ownership owns its file, and removes it unless finish() was called
/// @threads  one at a time
/// @realtime never
class NewRecording {
 public:
  /// @errors   the file exists and kRefuse, or cannot be written
  [[nodiscard]] static expected<NewRecording, SetupError> create(
      const std::string& path, WriterConfig config = {}, Existing existing = Existing::kRefuse);
  NewRecording(NewRecording&&) noexcept = default;
  NewRecording& operator=(NewRecording&&) = delete;
  ~NewRecording();

  [[nodiscard]] FileWriter& writer() noexcept { return *writer_; }
  /// Closes the file, and renames it to its final name.
  /// @return   the number of messages in the recording
  [[nodiscard]] expected<std::uint64_t, SetupError> finish();

 private:
  explicit NewRecording(std::string path) noexcept : path_(std::move(path)) {}
  [[nodiscard]] std::string draft() const { return path_ + ".part"; }

  std::string path_;
  std::unique_ptr<FileWriter> writer_{};
};

}  // namespace rtpm::recording
