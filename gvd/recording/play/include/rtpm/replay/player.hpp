#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/recording/recorder.hpp"
#include "rtpm/replay/recorded.hpp"
#include "rtpm/rpc/node.hpp"
#include "rtpm/rpc/server.hpp"

namespace rtpm::replay {

/// A device's behaviour after its last sample.
enum class End : std::uint8_t {
  /// The device is lost, as if unplugged: lifecycle fault, kDeviceGone, and the lease ends.
  kGone,
  kHold,  ///< Keeps showing the last sample.
  kLoop,  ///< Starts over.
};

/// Settings of a player.
struct PlayerConfig {
  std::string registry{};   ///< Registry for the devices' names; empty for no names.
  std::string hub{};        ///< The hub for events, a name or a URL; empty for no events.
  std::string folder{};     ///< Prefix of each name: "replay" turns lab/arm0 into replay/lab/arm0.
  double speed = 1;         ///< Seconds of the recording per second; 0.001 to 1000.
  bool is_stepped = false;  ///< Each read of a device returns its next sample; `speed` is ignored.
  End end = End::kGone;
  /// How long devices are lost before is_over(), so that their clients notice.
  Duration farewell = std::chrono::seconds{1};
  /// Records the commands that the devices accept; may be null, must outlive the player.
  recording::Recorder* commands = nullptr;
  rpc::ServerConfig server{.name = "rtpm play"};
};

/// Progress of a player.
struct PlayerStatus {
  Duration at{};            ///< Position in the recording; in steps, of the farthest sample.
  std::uint64_t round = 0;  ///< Repetitions.
  std::uint64_t read_count = 0;
  std::uint64_t command_count = 0;  ///< Commands accepted.
  std::uint64_t refused_count = 0;  ///< Commands refused.
  std::uint64_t pushed_count = 0;   ///< Events pushed.
  std::uint64_t failed_count = 0;   ///< Events that could not be sent to the hub.
};

/// Plays a recording: serves its devices under their names, and pushes its events to a hub. In
/// steps, events follow the device that is farthest ahead. The player ends after the last sample
/// and event; in steps, once each device has shown its last sample. With End::kHold or kLoop it
/// does not end.
/// @ownership refers to its node and recording, which must outlive it
/// @threads  any
class Player {
 public:
  /// Serves the devices; playing starts with start().
  /// @realtime set-up only; waits for a name that another server has just held
  /// @errors   a speed out of range; a name that is bound already; no registry, or no hub, answers
  [[nodiscard]] static expected<std::unique_ptr<Player>, SetupError> create(
      rpc::Node& node, const Recorded& recorded, PlayerConfig config);
  Player(const Player&) = delete;
  Player& operator=(const Player&) = delete;
  /// Calls stop().
  ~Player();

  /// Starts playing, on a time-shared thread "rtpm-play".
  /// @errors   no thread left
  [[nodiscard]] expected<void, SetupError> start();
  [[nodiscard]] bool is_over() const noexcept;
  /// Unbinds the names, then stops serving. May be called again.
  void stop() noexcept;

  [[nodiscard]] PlayerStatus status() const;
  /// The names and URLs under which the devices are served.
  struct Served {
    std::string name;
    std::string url;
  };
  [[nodiscard]] const std::vector<Served>& served() const noexcept;
  /// Event types unknown to the hub: they are pushed, but filters can't read their fields.
  [[nodiscard]] std::vector<std::string> unknown_types() const;

 private:
  struct Impl;
  explicit Player(std::unique_ptr<Impl> impl) noexcept;
  std::unique_ptr<Impl> impl_;
};

}  // namespace rtpm::replay
