#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "channels/channel_table.hpp"
#include "live/callbacks.hpp"
#include "recording/folder.hpp"
#include "recording/replay_player.hpp"
#include "rtpm/capture/live_recording.hpp"
#include "rtpm/capture/session.hpp"
#include "rtpm/rpc/node.hpp"
#include "services/call_router.hpp"
#include "work/worker_pool.hpp"

namespace rtpm::console {

/// The services that record the hub's events and play recordings, shared by all browsers.
/// @ownership refers to all its arguments
/// @threads  the web server's thread, except stop_reading() and close()
class RecordDesk {
 public:
  struct Config {
    std::string hub{};
    std::string registry{};  ///< The registry with the devices' names.
    std::filesystem::path folder{};
  };
  RecordDesk(rpc::Node& node, Config config, CallRouter& router, ChannelTable& channels,
             WorkerPool& pool, Post post);

  /// Adds the services, and starts a separate thread that reads files.
  /// @errors   no thread could be started
  [[nodiscard]] expected<void, SetupError> start();
  [[nodiscard]] nlohmann::ordered_json recording_json() const;
  [[nodiscard]] nlohmann::ordered_json replay_json() const;
  /// Why the recording must stay as it is; empty if it need not.
  [[nodiscard]] std::string use_of(const std::string& file) const;
  /// The folder, for others who read and change recordings.
  [[nodiscard]] RecordingFolder& folder() noexcept { return folder_; }
  /// Stops reading files. Work that it has posted must not run afterwards.
  void stop_reading();
  /// Ends recording and replay, once no other thread runs.
  void close();

 private:
  using Json = nlohmann::json;
  void start_recording(const PendingCall& call, const Json& request, bool is_session = false);
  void stop_recording(const PendingCall& call);
  void list(const PendingCall& call);
  /// Returns false when the desk ends, another recording is requested, or it takes too long.
  [[nodiscard]] recording::Progress patience(std::uint64_t replay_id);
  void open_replay(const PendingCall& call, const Json& request);
  void show_replay(const PendingCall& call, const std::string& file,
                   std::shared_ptr<ReplayPlayer> player);
  void close_replay();
  void deliver(std::uint64_t replay_id, std::uint16_t channel, std::uint64_t log_time_ns,
               std::string payload);

  rpc::Node& node_;
  Config config_;
  CallRouter& router_;
  ChannelTable& channels_;
  WorkerPool& pool_;
  Post post_;
  RecordingFolder folder_;
  /// Reads files on its own thread, as files of unknown origin may keep a thread busy.
  WorkerPool reading_{};
  std::atomic<bool> is_ending_{false};
  mutable std::mutex mutex_{};
  std::shared_ptr<capture::LiveRecording> recording_{};  ///< Guarded by `mutex_`.
  bool is_changing_ = false;                             ///< A start or stop is in progress.
  std::string recorded_file_{};
  std::optional<capture::Session> session_{};  ///< The current recording has it.
  std::string problem_{};
  std::shared_ptr<ReplayPlayer> player_{};
  std::string played_file_{};
  std::atomic<std::uint64_t> replay_id_{0};
  std::map<std::uint16_t, std::uint32_t> replay_channels_{};
};

}  // namespace rtpm::console
