#pragma once

#include <cstdint>
#include <string_view>

#include "rtpm/base/time.hpp"

namespace rtpm::rt {

/// How a thread waits for something to arrive.
enum class WaitStrategy : std::uint8_t {
  kAdaptive,  ///< Spins for a bounded time, then blocks: fast while busy, idle when idle. A lane
              ///< whose next call seldom comes within that time blocks at once.
  kBlock,     ///< Blocks at once: no wasted cycle, the wake-up's latency each time.
  kPeriodic,  ///< Like kAdaptive, but if callers come at a steady pace it sleeps between them and
              ///< is awake, spinning, when each comes: spinning's latency for some per cent of a
              ///< core. For servers; elsewhere it is kAdaptive.
  kSpin,      ///< Never blocks: least latency for a whole core, which must be the thread's own.
              ///< Where the kernel throttles real-time threads, one at SCHED_FIFO blocks for some
              ///< per cent of the time all the same, a little at a time: see budget.hpp.
};

/// A wait strategy with its bound.
struct WaitConfig {
  WaitStrategy strategy = WaitStrategy::kAdaptive;
  /// How long kAdaptive spins before it blocks: about the cost of a block, since a sleeping CPU of
  /// a virtual machine takes up to 0.1 ms to wake. Blocking earlier costs twice for replies that
  /// take a little longer than usual.
  Duration spin = std::chrono::microseconds{100};
};

/// "adaptive", "block" or "spin".
[[nodiscard]] std::string_view to_string(WaitStrategy strategy) noexcept;

}  // namespace rtpm::rt
