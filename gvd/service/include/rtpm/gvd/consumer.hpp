#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/events/consumer.hpp"
#include "rtpm/events/defaults.hpp"
#include "rtpm/gvd/device_event.hpp"
#include "rtpm/gvd/sample_sink.hpp"
#include "rtpm/rpc/node.hpp"

namespace rtpm::gvd {

/// Configures a consumer of devices' events.
struct DeviceConsumerConfig {
  std::string hub{events::kHubPath};  ///< A name or a URL.
  /// The devices that DeviceEvent::device names.
  std::vector<std::string> devices{};
  /// Filter, delivery, priority and other settings of the subscription. Without a filter it
  /// receives the samples and changes of `devices`. Fields of device events need no `types`.
  events::ConsumerConfig subscription{.name = "devices"};
};

/// Receives devices' events.
/// @threads  one call at a time; see events::EventHandler
class DeviceEventHandler {
 public:
  DeviceEventHandler() = default;
  DeviceEventHandler(const DeviceEventHandler&) = delete;
  DeviceEventHandler& operator=(const DeviceEventHandler&) = delete;
  virtual ~DeviceEventHandler() = default;
  /// One delivery: an event, or the events of a conjunction in the order of the filter's children.
  /// Valid during the call.
  virtual void on_events(std::span<const DeviceEvent> events) = 0;
  /// Reports the hub's notices: subscribed, interrupted, subscribed again after a gap, losses.
  virtual void on_notice(const events::Notice& notice) { static_cast<void>(notice); }
};

/// Subscribes to device events at a hub: the paper's GVDConsumer. The consumer decides what it
/// receives, how often and at which priority; the devices never wait for it:
///
///     DeviceConsumerConfig config{.devices = {"lab/arm0", "lab/gaze0"}};
///     config.subscription.filter = events::any_of(
///         {events::correlate({pressed("lab/arm0", 0), samples_of("lab/gaze0")}, 5ms),
///          events::silence(50ms)});
///     auto consumer = DeviceConsumer::start(node, config, handler);
///
/// It resubscribes automatically when the hub restarts, and reports the gap. An absent device is
/// not an error: its events arrive once it is there.
/// @ownership refers to its node and handler, which must outlive it
/// @threads  any
class DeviceConsumer {
 public:
  /// @realtime set-up only
  /// @errors   those of events::Consumer::create(): no hub answers, or it refuses the filter
  [[nodiscard]] static expected<DeviceConsumer, SetupError> start(rpc::Node& node,
                                                                  DeviceConsumerConfig config,
                                                                  DeviceEventHandler& handler);
  /// Subscribes only to the samples of `device`, by its name. Replaces `config.devices` and the
  /// filter.
  [[nodiscard]] static expected<DeviceConsumer, SetupError> start(rpc::Node& node,
                                                                  std::string_view device,
                                                                  DeviceConsumerConfig config,
                                                                  SampleSink& sink);
  DeviceConsumer(DeviceConsumer&&) noexcept;
  DeviceConsumer& operator=(DeviceConsumer&&) noexcept;
  /// Unsubscribes, and waits until the handler has returned.
  ~DeviceConsumer();

  /// The underlying consumer, to change, suspend or end the subscription, and for its counters.
  [[nodiscard]] events::Consumer& subscription() noexcept;
  /// The number of events omitted because they are malformed, of another version, or of no device.
  [[nodiscard]] std::uint64_t unreadable_count() const noexcept;

 private:
  struct Impl;
  explicit DeviceConsumer(std::unique_ptr<Impl> impl) noexcept;
  std::unique_ptr<Impl> impl_;
};

}  // namespace rtpm::gvd
