#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/capture/session.hpp"
#include "rtpm/events/defaults.hpp"
#include "rtpm/names/defaults.hpp"
#include "rtpm/recording/recorder.hpp"
#include "rtpm/rpc/node.hpp"

namespace rtpm::capture {

/// Settings for LiveRecording::start().
struct LiveRecordingConfig {
  std::string hub{events::kHubPath};            ///< A name or a URL.
  std::string registry{names::kThisHost};       ///< Name service of the devices.
  Duration deadline = std::chrono::seconds{1};  ///< The deadline of calls to the hub.
  recording::RecorderConfig recorder{};
  /// Names or URLs of cameras and microphones, which are recorded, too; see MediumRecorder. With
  /// any, the recorder takes messages of at least kPictureByteMax.
  std::vector<std::string> media{};
  std::optional<Session> session{};  ///< See check().
  /// Only these devices and event types, see selection_of(); all if both are empty. Parameters are
  /// recorded of these devices, and of each one of which an event is.
  std::vector<std::string> devices{};
  std::vector<std::string> topics{};
};

/// The counts of a live recording so far.
struct LiveRecordingStatus {
  Duration time{};
  recording::RecorderStatus recorder{};
  std::uint64_t lost_count = 0;  ///< Events and pictures that did not reach the recorder.
  /// Devices without a description: they are recorded, but can't be played.
  std::vector<std::string> undescribed_devices{};
  /// Sentences about what is missing, such as devices whose parameters could not be read; at most 32.
  std::vector<std::string> reports{};
};

/// Records all events of a hub in a file while the program runs, like `rtpm record`, but in
/// process. Devices have topics by their names, and descriptions, so `rtpm play` can play them.
/// @ownership owns the file and a thread "rtpm-record"; refers to its node, which must outlive it
/// @threads  any
/// @realtime set-up only, except Track::put() of a track from recorder().add_track()
class LiveRecording {
 public:
  /// @errors   no hub or medium answers; the file exists, or can't be written; those of check() and
  ///           selection_of()
  [[nodiscard]] static expected<std::unique_ptr<LiveRecording>, SetupError> start(
      rpc::Node& node, const std::string& file, LiveRecordingConfig config = {});
  LiveRecording(const LiveRecording&) = delete;
  LiveRecording& operator=(const LiveRecording&) = delete;
  /// Calls stop() and ignores its result.
  ~LiveRecording();

  /// Records a remark at the current time, in the topic "annotations".
  /// @return   false if it was too long, or the recorder is full; it counts as dropped
  bool annotate(std::string_view text);
  /// The recorder, for the program's own channels.
  [[nodiscard]] recording::Recorder& recorder() noexcept;
  [[nodiscard]] LiveRecordingStatus status() const;
  /// Ends the recording. No other call may follow.
  /// @errors   an error of the file, possibly an earlier one; the data written so far is intact
  [[nodiscard]] expected<void, SetupError> stop();

 private:
  struct Impl;
  explicit LiveRecording(std::unique_ptr<Impl> impl) noexcept;
  std::unique_ptr<Impl> impl_;
};

}  // namespace rtpm::capture
