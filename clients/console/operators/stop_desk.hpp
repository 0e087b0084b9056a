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

/// Emergency stops that browsers request. A stop that did not reach its device stays pending, and
/// is shown on the page, until it is delivered or an operator dismisses the device.
/// @ownership refers to all its arguments
/// @threads  the web server's thread, except deliver()
class StopDesk {
 public:
  /// @param urgent  runs emergency stops only
  StopDesk(rpc::Node& node, gvd::StopDeliveryConfig config, CallRouter& router, WorkerPool& urgent,
           Post post);

  /// Adds the service console/estop.
  void start();
  /// Remembers the device's URL, so that a stop goes there even when its name has expired.
  void remember(const std::string& device, const std::string& url);
  void dismiss(const std::string& device);
  /// Tries to deliver the pending stops; blocks for at most a second.
  /// @threads  one
  void deliver();

  /// The devices with a pending stop.
  [[nodiscard]] std::set<std::string> owed_devices() const;
  /// The `not_stopped` member of `console/state`.
  [[nodiscard]] nlohmann::ordered_json owed_json(MonotonicTime now) const;

 private:
  void stop(const PendingCall& call, const nlohmann::json& request);

  CallRouter& router_;
  WorkerPool& urgent_;
  Post post_;
  gvd::StopDelivery delivery_;
};

}  // namespace rtpm::console
