#pragma once

#include <condition_variable>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/recording/file_reader.hpp"
#include "rtpm/rt/thread.hpp"

namespace rtpm::console {

/// Plays a recording at its own pace or another pace, on a separate thread. Channels with many
/// messages are decimated to 60 per second.
/// @threads  any
class ReplayPlayer {
 public:
  /// Receives a message on the player's thread.
  using Deliver =
      std::function<void(std::uint16_t channel, std::uint64_t log_time_ns, std::string payload)>;

  struct Status {
    std::uint64_t time_ns = 0;
    double speed = 1;
    bool is_playing = false;
    std::string problem{};  ///< The damage of the file; empty if there is none.
  };

  /// The limits of a page.
  static constexpr std::size_t kChannelCountMax = 1'000;
  static constexpr std::size_t kSchemaByteMax = 16 << 20;

  /// Opens a recording, even one that was not ended. It does not play yet.
  /// @param progress  may stop the opening
  /// @errors   as FileReader::open(); more channels or schemas than a page can show
  [[nodiscard]] static expected<std::unique_ptr<ReplayPlayer>, SetupError> open(
      const std::string& path, Deliver deliver, const recording::Progress& progress);
  ReplayPlayer(const ReplayPlayer&) = delete;
  ReplayPlayer& operator=(const ReplayPlayer&) = delete;
  ~ReplayPlayer();

  [[nodiscard]] std::uint64_t begin_ns() const noexcept { return begin_ns_; }
  [[nodiscard]] std::uint64_t end_ns() const noexcept { return end_ns_; }
  /// The file's channels at the time of opening.
  [[nodiscard]] const std::map<std::uint16_t, recording::Channel>& channels() const noexcept {
    return channels_;
  }
  [[nodiscard]] const std::map<std::uint16_t, recording::Schema>& schemas() const noexcept {
    return schemas_;
  }

  /// Plays from the present time on, or from the beginning if it is at its end.
  /// @param speed  0.01 to 100
  void play(double speed);
  void pause();
  /// Seeks to a time; delivers the newest message of each channel up to then, and for curves some
  /// of the half minute before it.
  void seek(std::uint64_t time_ns);
  [[nodiscard]] Status status() const;

 private:
  ReplayPlayer(std::unique_ptr<recording::FileReader> reader, Deliver deliver);
  void run();
  void show_moment(std::uint64_t time_ns, std::uint64_t turn);
  /// Waits until browsers have had time to take the batch; false if another command is pending.
  [[nodiscard]] bool pause_delivery(std::uint64_t turn);
  void play_on(std::uint64_t from_ns, std::uint64_t turn);
  /// Waits until the message is due; false if another command is pending.
  [[nodiscard]] bool wait_for(std::uint64_t log_time_ns, std::uint64_t turn);
  [[nodiscard]] bool is_shown(std::uint16_t channel);
  /// Whether the turn still is the present one.
  [[nodiscard]] bool is_present(std::uint64_t turn) const;

  std::unique_ptr<recording::FileReader> reader_;
  Deliver deliver_;
  std::uint64_t begin_ns_;
  std::uint64_t end_ns_;
  std::map<std::uint16_t, recording::Channel> channels_;
  std::map<std::uint16_t, recording::Schema> schemas_;
  std::map<std::uint16_t, bool> is_dense_{};        ///< Player's thread only.
  std::map<std::uint16_t, MonotonicTime> shown_{};  ///< Player's thread only.
  mutable std::mutex mutex_{};
  std::condition_variable changed_{};
  // Guarded by `mutex_`.
  Status status_{};
  std::uint64_t turn_ = 0;  ///< Counts commands.
  std::optional<std::uint64_t> sought_ns_{};
  MonotonicTime anchor_{};       ///< The moment at which `anchor_ns_` was played.
  std::uint64_t anchor_ns_ = 0;  ///< A time of the recording.
  bool is_stopping_ = false;
  rt::Thread thread_{};
};

}  // namespace rtpm::console
