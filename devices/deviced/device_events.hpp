#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "configuration.hpp"
#include "rtpm/base/setup_error.hpp"
#include "rtpm/events/hub_server.hpp"
#include "rtpm/gvd/emergency.hpp"
#include "rtpm/gvd/publisher.hpp"
#include "rtpm/gvd/server.hpp"
#include "rtpm/gvd/stop_keeper.hpp"
#include "rtpm/gvd/system_stop.hpp"
#include "rtpm/rpc/node.hpp"
#include "rtpm/rt/log.hpp"

namespace rtpm::deviced {

/// Pushes the events of this program's devices to a hub, perhaps its own, and stops the devices in
/// an emergency.
/// @ownership refers to its node; outlives the devices
/// @threads  set-up from one; stop_devices() and stop_system() from any
class DeviceEvents final : public gvd::EmergencyStops {
 public:
  /// Serves the hub, if the configuration says so.
  /// @realtime set-up only
  /// @errors   as events::HubServer::create()
  [[nodiscard]] static expected<std::unique_ptr<DeviceEvents>, SetupError> create(
      rpc::Node& node, const Configuration& configuration);

  /// The observer of the device that is bound as `name`; null if events are off.
  /// @errors   as gvd::DevicePublisher::add()
  [[nodiscard]] expected<gvd::CycleObserver*, SetupError> observe(std::string_view name);
  /// The keeper of stops. Add the device and attach its server before the rpc::Server starts.
  [[nodiscard]] gvd::StopKeeper& stops() noexcept { return stops_; }
  /// Begins to push events.
  /// @errors   as gvd::DevicePublisher::start()
  [[nodiscard]] expected<void, SetupError> start_publishing();
  /// Keeps stops, and takes part in the system-wide emergency stop, until stop().
  /// @errors   as gvd::StopKeeper::start() and gvd::SystemStop::start()
  [[nodiscard]] expected<void, SetupError> start_stops(rpc::Node& node);
  /// Call before the devices end.
  void stop() noexcept;

  /// Publishes a change of parameters, as gvd::DevicePublisher::publish_configuration() does.
  void publish_configuration(std::string_view name, std::uint64_t revision,
                             std::span<const std::string> names);
  void stop_devices() noexcept override;
  [[nodiscard]] bool stop_system() noexcept override;

 private:
  /// Logs changes of the hub and of kept stops.
  class Reporter final : public gvd::DeviceListener {
   public:
    void report(std::string_view text) override { log_.write(std::string(text)); }

   private:
    rt::Log log_{"rtpm-deviced"};
  };

  explicit DeviceEvents(const Configuration& configuration);

  std::string hub_url_;  ///< The hub's URL or name; empty if events are off.
  rt::RealtimeMode realtime_;
  Reporter reporter_{};
  std::unique_ptr<events::HubServer> hub_{};
  std::unique_ptr<gvd::DevicePublisher> publisher_{};
  Reporter stop_reporter_{};
  gvd::StopKeeper stops_;
  std::unique_ptr<gvd::SystemStop> system_stop_{};
};

}  // namespace rtpm::deviced
