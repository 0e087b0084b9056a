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

/// Settings for HubRecorder::create().
struct HubRecorderConfig {
  std::string hub{events::kHubPath};            ///< By name or URL.
  std::string registry{names::kThisHost};       ///< Name service of the devices.
  Duration deadline = std::chrono::seconds{1};  ///< The deadline of calls to the hub.
  events::Filter filter = events::everything();
  std::uint32_t every_nth = 1;  ///< Only the first event, and then each n-th.
  Priority priority{};          ///< The hub's default if unset.
};

/// Records the events of a hub, and the descriptions of the devices that push some of them. Each
/// type and source has a channel of its own, of a device by its name. Events whose type or name is
/// not known yet are held back, at most 3 s and 2 MiB in all.
/// @ownership refers to its node and recorder, which must outlive it
/// @threads  attend() and finish() on one, the rest on any
/// @realtime none
class HubRecorder {
 public:
  /// @param types  those of the hub, which was asked before the recorder made its file
  /// @errors   no hub answers; it refuses the filter
  [[nodiscard]] static expected<std::unique_ptr<HubRecorder>, SetupError> create(
      rpc::Node& node, recording::Recorder& recorder, events::HubTypes types,
      const HubRecorderConfig& config);
  HubRecorder(const HubRecorder&) = delete;
  HubRecorder& operator=(const HubRecorder&) = delete;
  ~HubRecorder();

  /// Asks for unknown types and names, and describes new devices. Call it a few times per second.
  void attend();
  /// Ends the subscription, and records the events that are held back. Call it before the recorder
  /// is closed.
  void finish();
  /// Events that did not reach the recorder.
  [[nodiscard]] std::uint64_t lost_count() const;
  /// Sentences since the last call: losses, interruptions, devices that can't be played.
  [[nodiscard]] std::vector<std::string> take_reports();
  /// Devices that gave no description: they are recorded, but can't be played.
  [[nodiscard]] std::vector<std::string> undescribed_devices() const;

 private:
  struct Impl;
  explicit HubRecorder(std::unique_ptr<Impl> impl) noexcept;
  std::unique_ptr<Impl> impl_;
};

/// The notice of a subscription to `hub` in words; empty where there is nothing to say.
[[nodiscard]] std::string text_of(const events::Notice& notice, const std::string& hub);

}  // namespace rtpm::capture
