#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "rtpm/base/priority.hpp"
#include "rtpm/base/setup_error.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/events/defaults.hpp"
#include "rtpm/events/event.hpp"
#include "rtpm/rpc/node.hpp"
#include "rtpm/rt/thread.hpp"

namespace rtpm::gvd {

/// The event that stops every device of a system, and its source.
/// @source   schema/idl/device_events.fbs
inline constexpr events::EventType kStopAllRequested = 1380974601;
inline constexpr events::SourceId kStopAllSource = 0;

/// A program's devices, as the system-wide emergency stop sees them.
/// @threads  any
/// @realtime alloc-free
class SystemStopDevices {
 public:
  SystemStopDevices() = default;
  SystemStopDevices(const SystemStopDevices&) = delete;
  SystemStopDevices& operator=(const SystemStopDevices&) = delete;
  virtual ~SystemStopDevices() = default;
  /// Stops the devices that have not yet obeyed the request `id`, neither now nor before a restart
  /// of their server.
  /// @return whether there was such a device
  virtual bool obey(std::uint64_t id) noexcept = 0;
  /// The newest request that a device has obeyed and that was not rearmed since, or 0.
  [[nodiscard]] virtual std::uint64_t obeyed() const noexcept = 0;
};

/// Configures a program's part in the system-wide emergency stop.
struct SystemStopConfig {
  std::string hub{events::kHubPath};  ///< A name or a URL; the same in the whole system.
  Duration retry = std::chrono::milliseconds{500};  ///< Pause between attempts to reach the hub.
  /// Interval at which a request is pushed again.
  Duration repeat = std::chrono::milliseconds{100};
  Duration repeat_for = std::chrono::seconds{5};  ///< How long a request is pushed.
  /// Interval at which an obeyed request is repeated until it is rearmed, for servers that start
  /// meanwhile. A request latched by a hub is valid for three times as long.
  Duration remind = std::chrono::seconds{1};
  /// Priority of the event, and of the thread that obeys it.
  Priority priority = Priority::kHighest;
  rt::RealtimeMode realtime = rt::RealtimeMode::kPrefer;
};

/// A program's part in the system-wide emergency stop: obeys requests of other programs by stopping
/// its own devices. Repeats its own request until `repeat_for` after a hub accepted it, so that it
/// reaches servers that are just resubscribing; without a hub it waits. A stopped device stays
/// stopped, whatever happens to the hub. While any of its devices is not rearmed, a program repeats
/// the request, so that a server that starts later is stopped, too.
/// @ownership refers to its node and devices, which must outlive it
/// @threads  request(): any
class SystemStop {
 public:
  /// Starts; connects to the hub in the background.
  /// @param devices  this program's; null if it has none, such as a panic button's program
  /// @realtime set-up only
  /// @errors   no thread left
  [[nodiscard]] static expected<std::unique_ptr<SystemStop>, SetupError> start(
      rpc::Node& node, SystemStopDevices* devices, const SystemStopConfig& config = {});
  SystemStop(const SystemStop&) = delete;
  SystemStop& operator=(const SystemStop&) = delete;
  ~SystemStop();

  /// Stops this program's devices at once, and requests all other programs to stop theirs.
  /// @realtime alloc-free
  void request() noexcept;
  /// Whether requests from other programs would arrive now.
  [[nodiscard]] bool is_subscribed() const noexcept;
  /// The number of requests that this program made, or that a device obeyed.
  [[nodiscard]] std::uint64_t stop_count() const noexcept;

 private:
  struct Impl;
  explicit SystemStop(std::unique_ptr<Impl> impl) noexcept;
  std::unique_ptr<Impl> impl_;
};

}  // namespace rtpm::gvd
