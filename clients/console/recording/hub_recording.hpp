#pragma once

#include <cstdint>
#include <memory>
#include <mutex>
#include <span>
#include <string>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/capture/event_recorder.hpp"
#include "rtpm/events/consumer.hpp"
#include "rtpm/events/hub_types.hpp"
#include "rtpm/recording/recorder.hpp"
#include "rtpm/rpc/node.hpp"

namespace rtpm::console {

/// Every event of a hub, recorded in a file.
/// @ownership refers to its node
/// @threads  care() and close() one at a time; status() any
class HubRecording final : public events::EventHandler {
 public:
  struct Status {
    double time_s = 0;
    recording::RecorderStatus recorder{};
    std::uint64_t lost_count = 0;  ///< Events that did not reach the recorder.
  };

  /// @errors   no hub; the file can't be written
  [[nodiscard]] static expected<std::unique_ptr<HubRecording>, SetupError> create(
      rpc::Node& node, const std::string& hub, const std::string& path);
  ~HubRecording() override;

  /// Learns types that came since. Call it now and then.
  void care();
  [[nodiscard]] Status status() const;
  /// @errors   the file's
  [[nodiscard]] expected<void, SetupError> close();

  void on_events(std::span<const events::EventView> events) override;

 private:
  HubRecording(rpc::Node& node, std::string hub, events::HubTypes types,
               std::unique_ptr<recording::Recorder> recorder);

  rpc::Node& node_;
  std::string hub_;
  MonotonicTime begin_;
  std::unique_ptr<recording::Recorder> recorder_;
  std::mutex mutex_{};
  // Guarded by `mutex_`.
  events::HubTypes types_;
  capture::EventRecorder events_;
  bool lacks_type_ = false;
  std::unique_ptr<events::Consumer> consumer_{};
};

}  // namespace rtpm::console
