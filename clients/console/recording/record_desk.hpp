#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <string>

#include "channels/channel_table.hpp"
#include "live/callbacks.hpp"
#include "recording/folder.hpp"
#include "recording/hub_recording.hpp"
#include "recording/replay_player.hpp"
#include "rtpm/rpc/node.hpp"
#include "services/call_router.hpp"
#include "work/worker_pool.hpp"

namespace rtpm::console {

/// The services that record the hub's events and play recordings, for all browsers together.
/// @ownership refers to all that it is given
/// @threads  the web server's, but for care() and close()
class RecordDesk {
 public:
  struct Config {
    std::string hub{};
    std::filesystem::path folder{};
  };
  RecordDesk(rpc::Node& node, Config config, CallRouter& router, ChannelTable& channels,
             WorkerPool& pool, Post post);

  /// Adds the services.
  void start();
  [[nodiscard]] nlohmann::ordered_json recording_json() const;
  [[nodiscard]] nlohmann::ordered_json replay_json() const;
  /// Call it now and then on a thread that may wait.
  void care();
  /// Ends recording and replay, when no other thread runs any more.
  void close();

 private:
  using Json = nlohmann::json;
  void start_recording(const PendingCall& call, const Json& request);
  void stop_recording(const PendingCall& call);
  void list(const PendingCall& call);
  void open_replay(const PendingCall& call, const Json& request);
  void show_replay(const PendingCall& call, const std::string& file,
                   std::shared_ptr<ReplayPlayer> player);
  void close_replay();
  void deliver(std::uint64_t replay_id, std::uint16_t channel, std::uint64_t log_time_ns,
               std::string payload);
  /// Fails the call and returns null if nothing is open.
  [[nodiscard]] ReplayPlayer* player_for(const PendingCall& call);

  rpc::Node& node_;
  Config config_;
  CallRouter& router_;
  ChannelTable& channels_;
  WorkerPool& pool_;
  Post post_;
  RecordingFolder folder_;
  mutable std::mutex mutex_{};
  std::shared_ptr<HubRecording> recording_{};  ///< Guarded by `mutex_`.
  bool is_changing_ = false;                   ///< A start or stop is under way.
  std::string recorded_file_{};
  std::string problem_{};
  std::shared_ptr<ReplayPlayer> player_{};
  std::string played_file_{};
  std::uint64_t replay_id_ = 0;
  std::map<std::uint16_t, std::uint32_t> replay_channels_{};
};

}  // namespace rtpm::console
