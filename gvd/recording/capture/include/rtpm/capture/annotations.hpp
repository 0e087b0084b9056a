#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/recording/recorder.hpp"
#include "rtpm/rt/pi_mutex.hpp"

namespace rtpm::capture {

/// The topic of annotations: JSON objects with `text`.
inline constexpr const char* kAnnotationTopic = "annotations";

/// Writes remarks of people and programs into a recording: when a trial began, what was seen.
/// @ownership refers to its recorder, which other sources may share
/// @threads  any; allocates and waits, so none of real time
class Annotations {
 public:
  /// Takes a track of its own.
  /// @errors   the file takes no more channels
  [[nodiscard]] static expected<std::unique_ptr<Annotations>, SetupError> create(
      recording::Recorder& recorder);
  Annotations(const Annotations&) = delete;
  Annotations& operator=(const Annotations&) = delete;
  ~Annotations() = default;

  /// Records `text` at the present time.
  /// @return   false if it was too long, or the recorder takes no more; it is counted as dropped
  bool annotate(std::string_view text);

 private:
  Annotations(recording::Recorder& recorder, std::uint16_t channel)
      : recorder_(recorder), track_(recorder.add_track()), channel_(channel) {}

  rt::PiMutex mutex_{};
  recording::Recorder& recorder_;
  recording::Recorder::Track& track_;
  std::uint16_t channel_;
  std::uint32_t sequence_ = 0;
};

}  // namespace rtpm::capture
