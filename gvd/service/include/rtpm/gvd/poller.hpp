#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "rtpm/base/priority.hpp"
#include "rtpm/base/setup_error.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/driver/sample.hpp"
#include "rtpm/gvd/sample_sink.hpp"
#include "rtpm/rpc/error.hpp"
#include "rtpm/rpc/node.hpp"
#include "rtpm/rt/thread.hpp"

namespace rtpm::gvd {

/// Configures a poller.
struct DevicePollerConfig {
  double rate_hz = 60;  ///< Polling rate, 0.1 to 10000.
  /// The poller's thread. Its priority, if any, is also the calls'.
  rt::ThreadConfig thread{.name = "poller"};
  Priority priority = 1000;  ///< The calls' priority if the thread has none.
};

/// Counters of a poller.
struct DevicePollerCounters {
  std::uint64_t pushed_count = 0;     ///< Samples handed to the sink.
  std::uint64_t unchanged_count = 0;  ///< Polls without a newer sample.
  std::uint64_t failed_count = 0;     ///< Failed polls.
};

/// Polls a device's newest sample on its own thread, at its own rate and priority, and passes each
/// new sample to a sink. For devices that push no events (see DeviceConsumer). Samples between two
/// polls are missed. Failed polls are counted and retried; a name is followed as rpc::Binding does.
/// @ownership refers to its node and its sink, which must outlive it
/// @threads  start and stop from one thread; the rest from any
class DevicePoller {
 public:
  /// Binds `device`, a name or a URL, and starts.
  /// @realtime set-up only
  /// @errors   those of rpc::Binding::bind(); a rate out of range; missing real-time rights with
  ///           RealtimeMode::kRequire
  [[nodiscard]] static expected<DevicePoller, SetupError> start(rpc::Node& node,
                                                                std::string_view device,
                                                                const DevicePollerConfig& config,
                                                                SampleSink& sink);
  DevicePoller(DevicePoller&&) noexcept;
  DevicePoller& operator=(DevicePoller&&) noexcept;
  /// Calls stop().
  ~DevicePoller();

  /// Ends the thread after the current push(). May be called again, but not from push().
  void stop() noexcept;

  /// @threads  any
  /// @realtime alloc-free
  [[nodiscard]] DevicePollerCounters counters() const noexcept;
  /// Why the last poll failed; nullopt if it succeeded.
  /// @threads  any
  /// @realtime alloc-free
  [[nodiscard]] std::optional<rpc::CallError> last_error() const noexcept;

 private:
  struct Impl;
  explicit DevicePoller(std::unique_ptr<Impl> impl) noexcept;
  std::unique_ptr<Impl> impl_;
};

}  // namespace rtpm::gvd
