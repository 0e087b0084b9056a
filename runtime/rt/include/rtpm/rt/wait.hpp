#pragma once

#include <cstdint>
#include <string_view>

#include "rtpm/base/time.hpp"

namespace rtpm::rt {

/// How a thread waits for something to arrive.
enum class WaitStrategy : std::uint8_t {
  /// Spins for a bounded time, then blocks: fast while busy, no CPU use while idle. A lane whose
  /// next call rarely arrives within that time blocks at once.
  kAdaptive,
  kBlock,  ///< Blocks at once: wastes no cycle, but pays the wake-up latency each time.
  /// Like kAdaptive, but if callers are periodic, it sleeps between calls and is already spinning
  /// when each arrives: the latency of spinning for a few per cent of a core. For servers;
  /// elsewhere it equals kAdaptive.
  kPeriodic,
  /// Never blocks: least latency for a whole core, which must be reserved for the thread. If the
  /// kernel throttles real-time threads, a SCHED_FIFO thread still blocks briefly for a few per
  /// cent of the time: see budget.hpp.
  kSpin,
};

/// A wait strategy with its bound.
struct WaitConfig {
  WaitStrategy strategy = WaitStrategy::kAdaptive;
  /// How long kAdaptive spins before it blocks: about the cost of a block, since a sleeping CPU of
  /// a virtual machine takes up to 0.1 ms to wake. Blocking earlier doubles the cost of replies
  /// that take slightly longer than usual.
  Duration spin = std::chrono::microseconds{100};
};

/// "adaptive", "block", "spin" or "periodic".
[[nodiscard]] std::string_view to_string(WaitStrategy strategy) noexcept;

}  // namespace rtpm::rt
