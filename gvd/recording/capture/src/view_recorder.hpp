#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "rtpm/driver/descriptor.hpp"
#include "rtpm/driver/sample.hpp"
#include "rtpm/events/event.hpp"
#include "rtpm/recording/recorder.hpp"
#include "rtpm/viewers/device_view.hpp"

namespace rtpm::capture {

/// Records what viewers draw of devices, from their samples.
/// @ownership refers to the recorder and its track
/// @threads  that of the track; allocates, so not for real-time threads
class ViewRecorder {
 public:
  ViewRecorder(recording::Recorder& recorder, recording::Recorder::Track& track) noexcept
      : recorder_(recorder), track_(track) {}

  /// Adds the channels of a device, unless it has them. A channel that the file has no place for is
  /// left out.
  void add(const std::string& device, const driver::Descriptor& descriptor);
  [[nodiscard]] bool has(events::SourceId source) const { return devices_.contains(source); }
  /// The models that an added device renders, for its next messages.
  /// @param publish_time_ns  of the event
  void set_models(events::SourceId source, const gvd::ModelList& models,
                  std::uint64_t publish_time_ns) noexcept;
  /// Records the messages that are due with a sample of an added device.
  /// @param publish_time_ns  of the measurement
  void record(events::SourceId source, const driver::Sample& sample, std::uint64_t log_time_ns,
              std::uint64_t publish_time_ns);

 private:
  struct Device {
    viewers::DeviceView view;
    std::vector<std::uint16_t> channels{};  ///< The numbers of the view's channels; 0: left out.
  };
  [[nodiscard]] std::uint16_t add_channel(const viewers::Channel& channel,
                                          const std::string& device);

  recording::Recorder& recorder_;
  recording::Recorder::Track& track_;
  std::map<events::SourceId, Device> devices_{};
  std::uint16_t transforms_ = 0;  ///< The channel of all devices; 0 before the first.
};

}  // namespace rtpm::capture
