#pragma once

#include <device.rtpm.hpp>

#include <cstdint>
#include <memory>
#include <string>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/recording/recorder.hpp"

namespace rtpm::capture {

/// Records the commands that a device accepted: topic "lab/arm0/command", a CommandRequest each.
/// The message's sequence is that of the sample which the device showed then. The lease's number,
/// which identifies its holder, stays out of the file.
/// @ownership refers to its recorder
/// @threads  any
class CommandRecorder {
 public:
  /// @realtime set-up only
  /// @errors   the file takes no more channels
  [[nodiscard]] static expected<std::unique_ptr<CommandRecorder>, SetupError> create(
      recording::Recorder& recorder, const std::string& device);
  CommandRecorder(const CommandRecorder&) = delete;
  CommandRecorder& operator=(const CommandRecorder&) = delete;
  ~CommandRecorder();

  /// Records a command; the recorder counts it as dropped if it can't take it.
  /// @realtime alloc-free; waits for another thread's copying, with priority inheritance
  void record(const device::Command& command, std::uint64_t sample_sequence) noexcept;

 private:
  struct Impl;
  explicit CommandRecorder(std::unique_ptr<Impl> impl) noexcept;
  std::unique_ptr<Impl> impl_;
};

}  // namespace rtpm::capture
