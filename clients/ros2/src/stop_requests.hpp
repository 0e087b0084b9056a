#pragma once

#include <condition_variable>
#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <vector>

#include "cyclone/participant.hpp"
#include "rtpm/base/setup_error.hpp"
#include "rtpm/gvd/stop_delivery.hpp"
#include "rtpm/rpc/node.hpp"
#include "rtpm/rt/log.hpp"
#include "rtpm/rt/thread.hpp"

namespace rtpm::ros2 {

/// Emergency stops that ROS requests: a Bool that is true, or an Empty, on "/rtpm/stop" stops every
/// device, and on "/rtpm/lab/arm0/stop" that device. A stop that did not reach its device is
/// repeated each second. No message rearms.
/// @ownership refers to its node, participant and log; owns its thread "rtpm-ros2-stop"
/// @threads  any
/// @realtime never
class StopRequests {
 public:
  /// @errors   the topic can't be subscribed
  [[nodiscard]] static expected<std::unique_ptr<StopRequests>, SetupError> create(
      rpc::Node& node, Participant& participant, gvd::StopDeliveryConfig config, rt::Log& log);
  StopRequests(const StopRequests&) = delete;
  StopRequests& operator=(const StopRequests&) = delete;
  ~StopRequests();

  /// Subscribes to a topic that stops `device`, or every device if that is empty.
  [[nodiscard]] expected<std::vector<std::unique_ptr<Subscription>>, SetupError> subscribe(
      Participant& participant, const std::string& device);
  /// Remembers where the device is, so that a stop goes there even when its name has expired.
  void remember(const std::string& device, const std::string& url);
  /// The devices that a stop has not reached yet.
  [[nodiscard]] std::set<std::string> owed() const;

 private:
  StopRequests(rpc::Node& node, gvd::StopDeliveryConfig config, rt::Log& log)
      : log_(log), delivery_(node, std::move(config)) {}
  void request(const std::string& device);
  void run();
  void stop(const std::string& device);

  rt::Log& log_;
  gvd::StopDelivery delivery_;
  std::mutex mutex_;  ///< Guards the next members.
  std::condition_variable changed_{};
  std::set<std::string> wanted_{};  ///< Devices to be stopped; "" for all.
  bool is_stopping_ = false;
  rt::Thread thread_{};
  std::vector<std::unique_ptr<Subscription>> all_{};
};

}  // namespace rtpm::ros2
