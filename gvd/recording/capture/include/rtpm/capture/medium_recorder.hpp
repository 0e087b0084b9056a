#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/recording/recorder.hpp"
#include "rtpm/rpc/node.hpp"

namespace rtpm::capture {

/// The largest picture that a recording of media takes, for RecorderConfig::message_byte_max; the
/// ring of its track is four times as large.
inline constexpr std::size_t kPictureByteMax = std::size_t{2} << 20;

/// The counts of a recorded medium so far.
struct MediumRecorderStatus {
  std::uint64_t video_count = 0;
  std::uint64_t sound_count = 0;
  std::uint64_t lost_count = 0;  ///< Pieces that the recorder was too slow for.
};

/// Records a camera or microphone, with the time of capture as the log time: "lab/cam0/video" as
/// foxglove.CompressedVideo or foxglove.CompressedImage, "lab/cam0/sound" as foxglove.RawAudio.
/// The channels' metadata have the uncertainty of the first piece's time, "rtpm.uncertainty_ns".
/// @ownership refers to its node and recorder
/// @threads  one
/// @realtime set-up only
class MediumRecorder {
 public:
  /// Binds `medium`, a name or a URL, and records it until stop().
  /// @errors   no such medium; it does not answer; no right
  [[nodiscard]] static expected<std::unique_ptr<MediumRecorder>, SetupError> start(
      rpc::Node& node, recording::Recorder& recorder, const std::string& medium);
  MediumRecorder(const MediumRecorder&) = delete;
  MediumRecorder& operator=(const MediumRecorder&) = delete;
  /// Calls stop().
  ~MediumRecorder();

  [[nodiscard]] MediumRecorderStatus status() const;
  /// Sentences on what went wrong since the last call.
  [[nodiscard]] std::vector<std::string> take_reports();
  /// Ends the reading, and writes the counts into the file as metadata "rtpm.medium". May be called
  /// again.
  void stop() noexcept;

 private:
  struct Impl;
  explicit MediumRecorder(std::unique_ptr<Impl> impl) noexcept;
  std::unique_ptr<Impl> impl_;
};

}  // namespace rtpm::capture
