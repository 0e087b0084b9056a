#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>

#include "rtpm/base/expected.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/rt/clock.hpp"

namespace rtpm::bench {

/// Six doubles, as in the paper.
inline constexpr std::size_t kPayloadSize = 48;

/// One calling thread's connection to a server: what all contenders of a case have in common.
/// Threads: one.
class Caller {
 public:
  virtual ~Caller() = default;

  /// Sends 48 bytes and waits until the server has sent them back; fails, with the reason, if it
  /// did not within a second or they differ.   RT: alloc-free when it succeeds.
  [[nodiscard]] virtual expected<void, std::string> echo() = 0;
  /// Like echo(), but the server computes for `duration` first, where the caller can ask for that.
  [[nodiscard]] virtual expected<void, std::string> work(Duration) { return echo(); }
};

/// One thread that keeps many echoes in flight.
/// Threads: one.
class Pipeline {
 public:
  static constexpr std::size_t kInFlight = 64;
  virtual ~Pipeline() = default;

  /// Makes `count` echoes, kInFlight of them at a time.
  [[nodiscard]] virtual expected<void, std::string> run(std::uint64_t count) = 0;
};

/// One call, to be made again and again by one thread; fails with the reason.
using Job = std::function<expected<void, std::string>()>;

/// Computes, without sleeping, until `duration` has passed: the work of both servers.
inline void compute_for(Duration duration) noexcept {
  const MonotonicTime end = rt::now() + duration;
  while (rt::now() < end) {
  }
}

}  // namespace rtpm::bench
