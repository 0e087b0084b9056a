#pragma once

#include <atomic>
#include <cstdint>
#include <device.rtpm.hpp>
#include <memory>
#include <string>

#include "rtpm/capture/device_recorder.hpp"
#include "rtpm/gvd/server.hpp"
#include "rtpm/replay/pace.hpp"
#include "rtpm/replay/player.hpp"
#include "rtpm/replay/recorded.hpp"

namespace rtpm::replay {

/// A recorded device served by an ordinary device server. Its driver is active while the recorded
/// device was, and its clients see the recorded samples bit by bit: at the current position, or in
/// steps, the next sample for each read(). Commands do not move it.
/// @ownership refers to `recorded` and `pace`, which must outlive it
/// @threads  start() and stop() from one; the rest from any
class ReplayedDevice final : public gvd::ClientView {
 public:
  /// @param recorded  has a sample and a valid description
  /// @param commands  records the accepted commands; may be null
  ReplayedDevice(const RecordedDevice& recorded, Pace& pace, End end,
                 std::unique_ptr<capture::CommandRecorder> commands);

  /// Starts the device's server.
  /// @param stops  the emergency stops of the hosting program
  /// @errors   those of gvd::DeviceServer::create() and start()
  [[nodiscard]] expected<void, SetupError> start(gvd::EmergencyStops& stops);
  /// The device's server, once started.
  [[nodiscard]] gvd::DeviceServer& server() noexcept { return *server_; }

  /// The sample at `now`, if the recorded device was active and is not over; otherwise null.
  /// @realtime alloc-free
  [[nodiscard]] const device::Sample* active(MonotonicTime now) const noexcept;
  /// The sample that clients see at `now`, without advancing a step; null before the first one.
  /// @realtime alloc-free
  [[nodiscard]] const device::Sample* shown(MonotonicTime now) const noexcept;

  device::Sample on_read(MonotonicTime now) noexcept override;
  void on_command(const device::Command& command, gvd::DeviceOutcome outcome,
                  MonotonicTime now) noexcept override;

  struct Counters {
    std::uint64_t read_count = 0;
    std::uint64_t command_count = 0;  ///< Commands accepted.
    std::uint64_t refused_count = 0;  ///< Commands refused.
  };
  [[nodiscard]] Counters counters() const noexcept;
  [[nodiscard]] const std::string& name() const noexcept { return recorded_.name; }

 private:
  [[nodiscard]] const device::Sample* next_sample(MonotonicTime now) noexcept;
  [[nodiscard]] bool is_gone(MonotonicTime now) const noexcept;

  const RecordedDevice& recorded_;
  Pace& pace_;
  End end_;
  std::unique_ptr<capture::CommandRecorder> commands_;
  std::atomic<bool> is_gone_{false};  ///< In steps: a read went beyond its last sample.
  std::atomic<std::uint64_t> step_count_{0};
  std::atomic<std::uint64_t> read_count_{0};
  std::atomic<std::uint64_t> command_count_{0};
  std::atomic<std::uint64_t> refused_count_{0};
  std::unique_ptr<gvd::DeviceServer> server_{};
};

}  // namespace rtpm::replay
