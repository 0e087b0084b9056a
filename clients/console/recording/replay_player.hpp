#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/recording/file_reader.hpp"
#include "rtpm/replay/playback.hpp"

namespace rtpm::console {

/// Plays a recording to pages. Channels with many messages are decimated to 60 per second.
/// @threads  any
class ReplayPlayer final : replay::Script {
 public:
  /// Receives a message on the player's thread.
  using Deliver =
      std::function<void(std::uint16_t channel, std::uint64_t log_time_ns, std::string payload)>;

  /// The limits of a page.
  static constexpr std::size_t kChannelCountMax = 1'000;
  static constexpr std::size_t kSchemaByteMax = 16 << 20;

  /// Opens a recording, even an incomplete one. Does not start playing.
  /// @param progress  can stop the opening
  /// @errors   those of FileReader::open(); more channels or schemas than a page can show
  [[nodiscard]] static expected<std::unique_ptr<ReplayPlayer>, SetupError> open(
      const std::string& path, Deliver deliver, const recording::Progress& progress);

  [[nodiscard]] std::uint64_t begin_ns() const noexcept { return begin_ns_; }
  [[nodiscard]] std::uint64_t end_ns() const noexcept { return end_ns_; }
  /// The file's channels at the time of opening.
  [[nodiscard]] const std::map<std::uint16_t, recording::Channel>& channels() const noexcept {
    return channels_;
  }
  [[nodiscard]] const std::map<std::uint16_t, recording::Schema>& schemas() const noexcept {
    return schemas_;
  }

  /// Plays from the current time, or from the beginning if it is at its end.
  /// @param speed  0.01 to 100
  void play(double speed);
  void pause() { playback_.pause(); }
  /// Seeks to a time. Delivers the newest message of each channel up to then and, for curves, some
  /// of the half minute before.
  void seek(std::uint64_t time_ns) { playback_.seek(at(time_ns)); }
  [[nodiscard]] replay::Playback::Status status() const { return playback_.status(); }
  [[nodiscard]] std::uint64_t time_ns(Duration at) const noexcept;

 private:
  ReplayPlayer(std::unique_ptr<recording::FileReader> reader, Deliver deliver);
  expected<void, SetupError> play(Duration from, const replay::Turn& turn) override;
  expected<void, SetupError> show(Duration at, const replay::Turn& turn) override;
  /// Converts a log time to the time since the recording's start.
  [[nodiscard]] Duration at(std::uint64_t log_time_ns) const noexcept;
  [[nodiscard]] bool is_shown(std::uint16_t channel);

  std::unique_ptr<recording::FileReader> reader_;
  Deliver deliver_;
  std::uint64_t begin_ns_;
  std::uint64_t end_ns_;
  std::map<std::uint16_t, recording::Channel> channels_;
  std::map<std::uint16_t, recording::Schema> schemas_;
  std::map<std::uint16_t, bool> is_dense_{};        ///< Player's thread only.
  std::map<std::uint16_t, MonotonicTime> shown_{};  ///< Player's thread only.
  replay::Playback playback_;
};

}  // namespace rtpm::console
