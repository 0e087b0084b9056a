#pragma once

#include <cstdint>
#include <device.rtpm.hpp>
#include <map>
#include <memory>
#include <string>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/driver/descriptor.hpp"
#include "rtpm/recording/recorder.hpp"
#include "rtpm/rpc/node.hpp"

namespace rtpm::capture {

/// Records devices themselves: their descriptions, from which a player re-creates them
/// (rtpm::replay), and, by polling, the samples of devices that publish no events. Topics:
/// "lab/arm0/description" with a Description whenever it is recorded, and "lab/arm0/sampled".
/// @ownership refers to its node and recorder
/// @threads  one
/// @realtime set-up only
class DeviceRecorder {
 public:
  DeviceRecorder(rpc::Node& node, recording::Recorder& recorder);
  DeviceRecorder(const DeviceRecorder&) = delete;
  DeviceRecorder& operator=(const DeviceRecorder&) = delete;
  /// Stops polling.
  ~DeviceRecorder();

  /// Gets the description of the device with that name, and records it.
  /// @errors   no such device; it does not answer
  [[nodiscard]] expected<driver::Descriptor, SetupError> describe(const std::string& name);
  /// Calls describe(), then polls `rate_hz` times per second and records each new sample, and what
  /// viewers draw of it.
  /// @errors   those of describe(); a rate out of range, see gvd::DevicePollerConfig
  [[nodiscard]] expected<void, SetupError> poll(const std::string& name, double rate_hz);
  /// Stops polling.
  void stop() noexcept;

  /// The number of failed polls by device; devices without failures are left out.
  [[nodiscard]] std::map<std::string, std::uint64_t> failed_counts() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Records the commands that a device accepted: topic "lab/arm0/command", a CommandRequest each.
/// The message's sequence is that of the device's sample at that time. The lease's number, which
/// identifies its holder, is not recorded.
/// @ownership refers to its recorder
/// @threads  any
class CommandRecorder {
 public:
  /// @realtime set-up only
  /// @errors   the file has no channel left
  [[nodiscard]] static expected<std::unique_ptr<CommandRecorder>, SetupError> create(
      recording::Recorder& recorder, const std::string& device);
  CommandRecorder(const CommandRecorder&) = delete;
  CommandRecorder& operator=(const CommandRecorder&) = delete;
  ~CommandRecorder();

  /// Records a command; if the recorder can't take it, it counts as dropped.
  /// @realtime alloc-free; waits for another thread's copy, with priority inheritance
  void record(const device::Command& command, std::uint64_t sample_sequence) noexcept;

 private:
  struct Impl;
  explicit CommandRecorder(std::unique_ptr<Impl> impl) noexcept;
  std::unique_ptr<Impl> impl_;
};

}  // namespace rtpm::capture
