#pragma once

#include "rtpm/base/setup_error.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/rt/thread.hpp"

namespace rtpm::rt {

/// Limits how deeply the machine's CPUs may sleep, so that waking takes no longer than a bound:
/// waking from the deepest sleep takes some hundred µs. Costs power.
/// @ownership the request lasts as long as this object, or the process
/// @threads  one at a time
/// @realtime set-up only
/// @source   the kernel's PM QoS interface, /dev/cpu_dma_latency
class CpuLatencyRequest {
 public:
  /// Creates an object without a request.
  CpuLatencyRequest() noexcept = default;
  /// Requests waking within `latency`, which the kernel rounds to whole µs; 0 forbids sleep. With
  /// kOff it requests nothing.
  /// @errors   with kRequire, the process lacks a right, or the system has no such requests. With
  ///           kPrefer it warns once instead
  [[nodiscard]] static expected<CpuLatencyRequest, SetupError> open(Duration latency,
                                                                    RealtimeMode mode);
  CpuLatencyRequest(CpuLatencyRequest&& other) noexcept;
  CpuLatencyRequest& operator=(CpuLatencyRequest&& other) noexcept;
  ~CpuLatencyRequest();

  /// Whether the system granted the request.
  [[nodiscard]] bool is_granted() const noexcept { return file_ >= 0; }

 private:
  int file_ = -1;
};

}  // namespace rtpm::rt
