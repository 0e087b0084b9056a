#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/recording/file_writer.hpp"

namespace rtpm::recording {

/// A name for a new recording, from the current UTC time: "rtpm-20261124-091500.mcap".
[[nodiscard]] std::string name_by_time();

/// Settings for Recorder::create().
struct RecorderConfig {
  WriterConfig writer{};
  std::size_t message_byte_max = 64 * 1024;  ///< A longer message is dropped and counted.
  std::size_t ring_byte_count = 4 << 20;     ///< Size per track; a power of two.
};

/// Counters of a recorder.
struct RecorderStatus {
  std::uint64_t message_count = 0;  ///< Written messages.
  std::uint64_t byte_count = 0;     ///< Bytes in the file.
  std::uint64_t drop_count = 0;     ///< Not recorded: the ring was full, or the message too long.
  /// Drops by channel; channels without drops are left out.
  std::map<std::uint16_t, std::uint64_t> drop_counts{};
  /// Why the recorder stopped writing; all further messages are dropped.
  std::optional<SetupError> problem{};
};

/// Records messages of real-time threads: they only copy into rings; the recorder's own thread
/// compresses and writes. A program that dies loses at most the last second and one chunk.
///
/// The file's metadata "rtpm.recorder" lists the dropped messages: after each second with drops,
/// and at the end.
/// @ownership owns the file and its thread
/// @threads  any
class Recorder {
 public:
  /// One thread's way to record messages.
  class Track {
   public:
    Track(const Track&) = delete;
    Track& operator=(const Track&) = delete;
    ~Track();
    /// Copies a message. All calls must come from the same thread.
    /// @param message  its channel must exist; with ascending log times the file can be read faster
    /// @return false if it was dropped and counted
    /// @realtime wait-free, alloc-free, no system call
    bool put(const Message& message) noexcept;

   private:
    friend class Recorder;
    struct Impl;
    explicit Track(std::unique_ptr<Impl> impl) noexcept;
    std::unique_ptr<Impl> impl_;
  };

  /// @realtime set-up only
  /// @errors   those of FileWriter::create(); no thread could be started
  [[nodiscard]] static expected<std::unique_ptr<Recorder>, SetupError> create(
      const std::string& path, RecorderConfig config = {});
  Recorder(const Recorder&) = delete;
  Recorder& operator=(const Recorder&) = delete;
  /// Calls close() and ignores its result.
  ~Recorder();

  /// Adds a schema; see FileWriter::add_schema().
  /// @realtime set-up only
  [[nodiscard]] expected<std::uint16_t, SetupError> add_schema(const Schema& schema);
  [[nodiscard]] expected<std::uint16_t, SetupError> add_channel(const Channel& channel);
  /// Writes metadata into the file, after the messages written so far.
  /// @errors   those of FileWriter; possibly an earlier error
  [[nodiscard]] expected<void, SetupError> write(const Metadata& metadata);
  /// Maximum size of a message.
  [[nodiscard]] std::size_t message_byte_max() const noexcept;
  /// Adds a track, which lives as long as the recorder. Allocates its ring.
  /// @realtime set-up only
  [[nodiscard]] Track& add_track();

  /// Converts a time of this host's monotonic clock to a log time: since 1970, by the wall clock at
  /// create(). Never goes back, even if the wall clock does.
  /// @realtime alloc-free
  [[nodiscard]] std::uint64_t log_time_ns(MonotonicTime time) const noexcept;

  [[nodiscard]] RecorderStatus status() const;
  /// Writes the messages in the rings, and ends the file. No put() may follow.
  /// @errors   an error of the file, possibly an earlier one; the data written so far is intact
  [[nodiscard]] expected<void, SetupError> close();

 private:
  struct Impl;
  explicit Recorder(std::unique_ptr<Impl> impl) noexcept;
  std::unique_ptr<Impl> impl_;
};

}  // namespace rtpm::recording
