#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "rtpm/base/priority.hpp"
#include "rtpm/base/setup_error.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/events/defaults.hpp"
#include "rtpm/events/hub.hpp"
#include "rtpm/gvd/device.hpp"
#include "rtpm/gvd/observer.hpp"
#include "rtpm/rpc/node.hpp"
#include "rtpm/rt/thread.hpp"

namespace rtpm::gvd {

/// Configures a publisher.
struct DevicePublisherConfig {
  std::string hub{events::kHubPath};  ///< A name or a URL.
  events::Hub* own_hub = nullptr;     ///< A hub in this program, instead of `hub`.
  /// Interval at which the devices' cycles are pushed as one batch.
  Duration interval = std::chrono::milliseconds{1};
  Duration retry = std::chrono::milliseconds{500};  ///< Pause between attempts to reach the hub.
  /// The force at which contact starts; it ends below half of it.
  double contact_force_newton = 0.05;
  /// The publisher's thread. Its priority, if any, is also the events'.
  rt::ThreadConfig thread{.name = "publisher", .priority = Priority{12000}};
  DeviceListener* listener = nullptr;  ///< May be null. Notified when the hub is absent or back.
};

/// Counters of a publisher.
struct DevicePublisherCounters {
  std::uint64_t pushed_count = 0;   ///< Events pushed to the hub.
  std::uint64_t failed_count = 0;   ///< Events that could not be sent to the hub.
  std::uint64_t no_hub_count = 0;   ///< Cycles that passed without a hub.
  std::uint64_t overrun_count = 0;  ///< Cycles that found their ring full.
};

/// Pushes the samples and changes of a program's devices to an event hub: the device as the paper's
/// supplier. A device's thread puts each cycle in a ring and never waits; the publisher's thread
/// finds the changes and pushes them. The hub may be absent at the start and may restart.
/// @ownership refers to its node and hub, which must outlive it; must outlive the devices' servers
/// @threads  add(), start() and stop() from one thread; the rest from any
class DevicePublisher {
 public:
  DevicePublisher(rpc::Node& node, DevicePublisherConfig config);
  DevicePublisher(const DevicePublisher&) = delete;
  DevicePublisher& operator=(const DevicePublisher&) = delete;
  /// Calls stop().
  ~DevicePublisher();

  /// Adds the device that is bound as `name`. Call before start(). Use the result as
  /// CycleConfig::observer.
  /// @realtime set-up only
  /// @errors   two names with the same source_of()
  [[nodiscard]] expected<CycleObserver*, SetupError> add(std::string_view name);
  /// @realtime set-up only
  /// @errors   no thread; missing real-time rights with RealtimeMode::kRequire
  [[nodiscard]] expected<void, SetupError> start();
  /// Pushes the remaining cycles, and ends the thread. May be called again.
  void stop() noexcept;

  /// Pushes that parameters of the device `name` have changed; like ParameterListener::on_change().
  /// @realtime set-up only
  void publish_configuration(std::string_view name, std::uint64_t revision,
                             std::span<const std::string> names);
  [[nodiscard]] DevicePublisherCounters counters() const noexcept;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace rtpm::gvd
