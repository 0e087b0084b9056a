#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "rtpm/base/expected.hpp"
#include "rtpm/base/priority.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/driver/sample.hpp"
#include "rtpm/rpc/error.hpp"
#include "rtpm/rpc/node.hpp"
#include "rtpm/rt/thread.hpp"

namespace rtpm::gvd {

/// How a consumer receives.
struct DeviceConsumerConfig {
  double rate_hz = 60;  ///< How often it looks for a newer sample, 0.1 to 10000.
  /// Of its thread; the thread's priority, if it has one, goes with its calls too.
  rt::ThreadConfig thread{.name = "consumer"};
  Priority priority = 1000;  ///< Of its calls, if its thread has none.
};

/// What a consumer received so far.
struct DeviceConsumerCounters {
  std::uint64_t pushed_count = 0;     ///< Samples handed to the sink.
  std::uint64_t unchanged_count = 0;  ///< Looks that found no newer sample.
  std::uint64_t failed_count = 0;     ///< Looks that failed.
};

/// Takes samples: what a display or a logger implements, as in the paper's Figure 5.
class SampleSink {
 public:
  SampleSink() = default;
  SampleSink(const SampleSink&) = delete;
  SampleSink& operator=(const SampleSink&) = delete;
  virtual ~SampleSink() = default;
  /// Takes one sample. It may block or allocate as long as the consumer itself can bear: nobody
  /// else waits for it.
  /// @threads  the consumer's, one call at a time
  virtual void push(const driver::Sample& sample) = 0;
};

/// Receives a device's samples on a thread of its own, at its own rate and priority, and hands each
/// new one to a sink's push(): the paper's GVDConsumer, for displays and loggers that must not slow
/// a servo loop down. It asks the device's server for the newest sample at its rate; samples that
/// came and went in between are not seen. A look that fails is counted, and the next one tries
/// again; by a name, it follows the name as rpc::Binding does.
/// @ownership refers to its node and its sink, which must outlive it
/// @threads  start and stop from one thread; the rest from any
class DeviceConsumer {
 public:
  /// Binds `device`, a name for the node's resolver or a URL, and starts.
  /// @realtime set-up only
  /// @errors   as rpc::Binding::bind(); a rate out of range; with RealtimeMode::kRequire, a right
  ///           that the process lacks
  [[nodiscard]] static expected<DeviceConsumer, rpc::SetupError> start(
      rpc::Node& node, std::string_view device, const DeviceConsumerConfig& config,
      SampleSink& sink);
  DeviceConsumer(DeviceConsumer&&) noexcept;
  DeviceConsumer& operator=(DeviceConsumer&&) noexcept;
  /// Stops.
  ~DeviceConsumer();

  /// Ends the thread after the push that runs; again is allowed, not from within push.
  void stop() noexcept;

  /// From any thread.
  /// @realtime alloc-free
  [[nodiscard]] DeviceConsumerCounters counters() const noexcept;
  /// Why the last look failed; nothing if it did not.   From any thread.
  /// @realtime alloc-free
  [[nodiscard]] std::optional<rpc::CallError> last_error() const noexcept;

 private:
  class Impl;
  explicit DeviceConsumer(std::unique_ptr<Impl> impl) noexcept;
  std::unique_ptr<Impl> impl_;
};

}  // namespace rtpm::gvd
