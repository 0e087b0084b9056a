#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/base/priority.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/rt/thread.hpp"
#include "rtpm/rt/wait.hpp"

namespace rtpm::bench {

/// What carries the bytes, for RTPM and for the raw floor alike.
enum class Carrier : std::uint8_t { kUdp, kTcp, kSharedMemory };
[[nodiscard]] std::string_view to_string(Carrier carrier) noexcept;

/// What a run is asked to do; every case reads its part.
struct Settings {
  std::vector<Carrier> carriers{Carrier::kUdp, Carrier::kTcp};
  std::vector<rt::WaitStrategy> waits{rt::WaitStrategy::kAdaptive};
  Duration spin = rt::WaitConfig{}.spin;       ///< How long the adaptive wait spins.
  std::uint64_t sample_count = 0;              ///< Per contender and result; 0: the case's own.
  std::vector<std::size_t> payload_sizes{48};  ///< Bytes, of `call`; 48 as in the paper.
  /// Results tell every latency, not only their distribution.
  bool tells_latencies = false;
  int round_count = 40;   ///< Of which the middles are reported.
  double rate_hz = 1000;  ///< Of callers that keep a pace.
  std::vector<int> low_caller_counts{0, 1, 4, 16};
  std::vector<int> client_counts{1, 10, 100, 1000};     ///< Of scale.
  std::vector<int> consumer_counts{1, 4, 16, 64, 256};  ///< Of events.
  /// Each consumer of events has a thread of its own, even where several could share one.
  bool has_own_threads = false;
  /// Of events, with peers: the supplier's program has the hub, beside peers without a broker.
  bool has_own_hub = false;
  /// Of events over UDP: by the hub's multicast.
  bool has_multicast = false;
  Duration work = std::chrono::microseconds{200};  ///< Of one low-priority call.
  std::uint32_t in_flight = 64;  ///< Calls of throughput that are on their way at a time.
  std::uint64_t call_count = 0;  ///< Of two-node; 0: sample_count, else the case's own.
  Duration deadline = std::chrono::milliseconds{20};  ///< Of a call of two-node.
  double drop_percent = 0;  ///< Of packets, that two-node loses in each direction.
  rt::RealtimeMode realtime = rt::RealtimeMode::kPrefer;
  std::vector<std::string> peers{};  ///< By name, or "all"; none: RTPM and the floor alone.
};

/// The priorities of the measured caller with its lane, and of the load with its own.
inline constexpr Priority kHighPriority{24000};
inline constexpr Priority kLowPriority{1000};
/// Where the high lane begins.
inline constexpr Priority kHighBand{16000};

/// Where the two sides run: callers on one CPU, servers on another, so that a wake-up costs the
/// same in every run. On a machine with a single CPU both are that one.
struct Placement {
  int client_cpu = 0;
  int server_cpu = 0;
};
/// The first two CPUs that this process may use.   Set-up only.
[[nodiscard]] Placement choose_placement();
/// Each of its CPUs once.
[[nodiscard]] std::vector<int> cpus_of(const Placement& placement);

/// How many samples a round has: a like part of those that were asked for, or else of
/// `count_default`; at least one.
[[nodiscard]] std::size_t samples_per_round(const Settings& settings, std::uint64_t count_default);

/// Rounds of a run, from one on and before another.
struct Rounds {
  int begin = 0;
  int end = 0;
};
/// The rounds of a run in so many parts, or less where there are less rounds. The servers are
/// started anew for each: where a process's memory comes to lie, and on which cores of the host,
/// moves the figures of shared memory by a third, and would else be in all of them.
[[nodiscard]] std::vector<Rounds> parts_of_run(int round_count, int part_count);

}  // namespace rtpm::bench
