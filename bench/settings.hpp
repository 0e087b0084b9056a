#pragma once

#include <algorithm>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/base/priority.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/rt/thread.hpp"
#include "rtpm/rt/wait.hpp"

namespace rtpm::bench {

/// The medium that carries the bytes, for RTPM and for the raw floor alike.
enum class Carrier : std::uint8_t { kUdp, kTcp, kSharedMemory };
[[nodiscard]] std::string_view to_string(Carrier carrier) noexcept;

/// The two sides that are measured.
enum class Side : std::uint8_t { kRtpm, kFloor };
inline constexpr Side kBothSides[] = {Side::kRtpm, Side::kFloor};

/// The options of a run; each case reads its part. main.cpp says what each one means.
struct Settings {
  std::vector<Carrier> carriers{Carrier::kUdp, Carrier::kTcp, Carrier::kSharedMemory};
  std::vector<rt::WaitStrategy> waits{rt::WaitStrategy::kAdaptive};
  std::uint64_t sample_count = 0;              ///< Per contender and result; 0 for the case's own.
  std::vector<std::size_t> payload_sizes{48};  ///< The paper's payload size.
  bool tells_latencies = false;
  int round_count = 40;
  double rate_hz = 1000;
  std::vector<int> low_caller_counts{0, 1, 4, 16};
  std::vector<int> client_counts{1, 10, 100, 1000};
  std::vector<int> consumer_counts{1, 4, 16, 64, 256};
  bool has_own_hub = false;
  bool has_multicast = false;
  bool is_sealed = false;
  rt::RealtimeMode realtime = rt::RealtimeMode::kPrefer;
  std::vector<std::string> peers{};  ///< By name, or kAllPeers; may be empty.

  /// The number of calls or events that take this long at the run's rate, at least one.
  [[nodiscard]] std::uint64_t paced_count(double seconds) const {
    return std::max<std::uint64_t>(1, static_cast<std::uint64_t>(seconds * rate_hz));
  }
};
inline constexpr std::string_view kAllPeers = "all";

/// The priorities of the measured caller with its lane, and of the load with its own.
inline constexpr Priority kHighPriority{24000};
inline constexpr Priority kLowPriority{1000};
/// The lowest priority of the high lane.
inline constexpr Priority kHighBand{16000};

/// The CPUs of the two sides: callers on one, servers on another, so that a wake-up costs the same
/// in every run. On a machine with a single CPU both are that one.
struct Placement {
  int client_cpu = 0;
  int server_cpu = 0;
};
/// The first two CPUs that this process may use.
/// @realtime set-up only
[[nodiscard]] Placement choose_placement();
/// Returns each CPU of the placement once.
[[nodiscard]] std::vector<int> cpus_of(const Placement& placement);

}  // namespace rtpm::bench
