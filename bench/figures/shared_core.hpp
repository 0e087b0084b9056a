#pragma once

#include <span>

namespace rtpm::bench {

/// How much of a CPU's core somebody else has at the moment. A CPU is as a rule one of two threads
/// of a core. Of a virtual machine the other one may be another machine's, which no figure of the
/// kernel shows: steal counts only whole CPUs. Yet while that computes, software takes up to twice
/// as long, and what a CPU waits for anyway does not, so that a ratio of both moves, too.
///
/// Seen by two loops, of which one waits for its own results and so takes the same time in any
/// case, and the other keeps all units of the core busy. Alone, the second takes about half of the
/// first's time, and as long if it has half of the core: 0.55 and 0.75 to 1.0 were seen.
/// Threads: one, which runs on each of the CPUs for 0.1 ms and is then where it was.
/// Set-up only: so outside of timed stretches, and with nobody spinning there who is as urgent.
class SharedCore {
 public:
  /// Beyond so many times what a CPU shows alone, it is not alone. Alone it varies by 4 %.
  static constexpr double kSharedMin = 1.2;

  /// The time of the second loop over the first's, on the CPU where that is largest; 0 of no CPU.
  [[nodiscard]] static double look(std::span<const int> cpus);
  /// The smallest that any look of this process gave. The first time some looks at `cpus` are
  /// taken for it, for 0.1 s at most.
  [[nodiscard]] static double alone(std::span<const int> cpus);
  /// Whether somebody else computes on one of the CPUs' cores now.
  [[nodiscard]] static bool is_shared(std::span<const int> cpus) {
    return is_shared(look(cpus), alone(cpus));
  }
  [[nodiscard]] static bool is_shared(double look, double alone) noexcept {
    return look > kSharedMin * alone;
  }
};

}  // namespace rtpm::bench
