#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "rtpm/base/priority.hpp"
#include "rtpm/base/setup_error.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/events/consumer.hpp"
#include "rtpm/events/defaults.hpp"
#include "rtpm/events/hub_types.hpp"
#include "rtpm/names/defaults.hpp"
#include "rtpm/recording/recorder.hpp"
#include "rtpm/rpc/node.hpp"

namespace rtpm::capture {

class ParameterRecorder;

/// Settings for HubRecorder::create().
struct HubRecorderConfig {
  std::string hub{events::kHubPath};            ///< A name or a URL.
  std::string registry{names::kThisHost};       ///< Name service of the devices.
  Duration deadline = std::chrono::seconds{1};  ///< The deadline of calls to the hub.
  events::Filter filter = events::everything();
  std::uint32_t every_nth = 1;  ///< Record only the first event, and then each n-th.
  Priority priority{};          ///< The hub's default if unset.
  /// Gets each device of which an event is recorded; must outlive the HubRecorder. None if null.
  ParameterRecorder* parameters = nullptr;
};

/// Records the events of a hub, and descriptions of the devices that push some of them. Each type
/// and source has its own channel; a device's channel has the device's name. Events whose type or
/// name is unknown are held back, at most 3 s and 2 MiB in all.
/// @ownership refers to its node and recorder, which must outlive it
/// @threads  attend() and finish(): one; the rest: any
/// @realtime none
class HubRecorder {
 public:
  /// @param types  the hub's types, queried before the recorder created its file
  /// @errors   no hub answers; it refuses the filter
  [[nodiscard]] static expected<std::unique_ptr<HubRecorder>, SetupError> create(
      rpc::Node& node, recording::Recorder& recorder, events::HubTypes types,
      const HubRecorderConfig& config);
  HubRecorder(const HubRecorder&) = delete;
  HubRecorder& operator=(const HubRecorder&) = delete;
  ~HubRecorder();

  /// Looks up unknown types and names, and describes new devices. Call it a few times per second.
  void attend();
  /// Ends the subscription, and records the held events. Call it before the recorder is closed.
  void finish();
  /// The number of events that did not reach the recorder.
  [[nodiscard]] std::uint64_t lost_count() const;
  /// Messages since the last call: losses, interruptions, devices that can't be played.
  [[nodiscard]] std::vector<std::string> take_reports();
  /// Devices without a description: they are recorded, but can't be played.
  [[nodiscard]] std::vector<std::string> undescribed_devices() const;

 private:
  struct Impl;
  explicit HubRecorder(std::unique_ptr<Impl> impl) noexcept;
  std::unique_ptr<Impl> impl_;
};

/// A notice of the subscription to `hub` as text; empty if there is nothing to report.
[[nodiscard]] std::string text_of(const events::Notice& notice, const std::string& hub);

}  // namespace rtpm::capture
