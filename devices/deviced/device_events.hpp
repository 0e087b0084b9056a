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

/// Pushes the events of this program's devices to a hub, which this program may host, and stops the
/// devices in an emergency.
/// @ownership refers to its node; must outlive the devices
/// @threads  set-up: one thread; stop_devices() and stop_system(): any thread
class DeviceEvents final : public gvd::EmergencyStops {
 public:
  /// Starts the hub if the configuration asks for it.
  /// @realtime set-up only
  /// @errors   those of events::HubServer::create()
  [[nodiscard]] static expected<std::unique_ptr<DeviceEvents>, SetupError> create(
      rpc::Node& node, const Configuration& configuration);

  /// Returns the observer of the device that is bound as `name`; null if events are off.
  /// @errors   those of gvd::DevicePublisher::add()
  [[nodiscard]] expected<gvd::CycleObserver*, SetupError> observe(std::string_view name);
  /// Stores emergency stops. Add the device and attach its server before the rpc::Server starts.
  [[nodiscard]] gvd::StopKeeper& stops() noexcept { return stops_; }
  /// Starts pushing events.
  /// @errors   those of gvd::DevicePublisher::start()
  [[nodiscard]] expected<void, SetupError> start_publishing();
  /// Stores stops and takes part in the system-wide emergency stop until stop() is called.
  /// @errors   those of gvd::StopKeeper::start() and gvd::SystemStop::start()
  [[nodiscard]] expected<void, SetupError> start_stops(rpc::Node& node);
  /// Call this before the devices are destroyed.
  void stop() noexcept;

  /// Publishes a change of parameters, like gvd::DevicePublisher::publish_configuration().
  void publish_configuration(std::string_view name, std::uint64_t revision,
                             std::span<const std::string> names);
  void stop_devices() noexcept override;
  [[nodiscard]] bool stop_system() noexcept override;

 private:
  /// Logs changes of the hub's state and of stored stops.
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
