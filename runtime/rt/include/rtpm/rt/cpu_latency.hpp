#pragma once

#include "rtpm/base/setup_error.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/rt/thread.hpp"

namespace rtpm::rt {

/// Keeps the CPUs of the whole machine from sleeping so deeply that waking takes longer than a
/// bound: a sleep of the deepest kind takes up to some hundred µs to wake from. It costs power.
/// @ownership the request stands as long as this lives, or the process
/// @threads  one at a time
/// @realtime set-up only
/// @source   the kernel's PM QoS interface, /dev/cpu_dma_latency
class CpuLatencyRequest {
 public:
  /// No request.
  CpuLatencyRequest() noexcept = default;
  /// Asks for waking within `latency`, which the kernel rounds to whole µs; 0 forbids sleep.
  /// Asks nothing with kOff.
  /// @errors   with kRequire, a right that the process lacks, or a system without such requests.
  ///           With kPrefer it warns once instead
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
