#pragma once

#include <nlohmann/json.hpp>
#include <set>
#include <string>

#include "live/callbacks.hpp"
#include "rtpm/gvd/stop_delivery.hpp"
#include "rtpm/rpc/node.hpp"
#include "services/call_router.hpp"
#include "work/worker_pool.hpp"

namespace rtpm::console {

/// Emergency stops that browsers ask for. A device that a stop did not reach is owed it, and told
/// on the page, until it is delivered or an operator dismisses the device.
/// @ownership refers to all that it is given
/// @threads  the web server's, but for deliver()
class StopDesk {
 public:
  /// @param urgent  runs emergency stops only
  StopDesk(rpc::Node& node, gvd::StopDeliveryConfig config, CallRouter& router, WorkerPool& urgent,
           Post post);

  /// Adds the service console/estop.
  void start();
  /// A device is at this URL: a stop goes there also when its name has expired.
  void remember(const std::string& device, const std::string& url);
  void dismiss(const std::string& device);
  /// Tries to deliver what is owed; blocks for a second at most.
  /// @threads  one
  void deliver();

  /// Devices that are owed a stop.
  [[nodiscard]] std::set<std::string> owed_devices() const;
  /// `console/state`'s `not_stopped`.
  [[nodiscard]] nlohmann::ordered_json owed_json(MonotonicTime now) const;

 private:
  void stop(const PendingCall& call, const nlohmann::json& request);

  CallRouter& router_;
  WorkerPool& urgent_;
  Post post_;
  gvd::StopDelivery delivery_;
};

}  // namespace rtpm::console
