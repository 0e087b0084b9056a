#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <vector>

#include "rtpm/base/time.hpp"

namespace rtpm::console {

/// One column of a histogram.
struct LatencyBin {
  double from_us = 0;
  double to_us = 0;
  std::uint64_t count = 0;
};

struct LatencySummary {
  double p50_us = 0;
  double p90_us = 0;
  double p99_us = 0;
  double p999_us = 0;
  double max_us = 0;
  std::uint64_t count = 0;
  std::uint64_t failed_count = 0;
  /// Eight bins per decade, from the first to the last used one.
  std::vector<LatencyBin> histogram{};
};

/// The latencies of the last five minutes.
/// @threads  one
class LatencyWindow {
 public:
  static constexpr Duration kSpan = std::chrono::minutes{5};
  static constexpr std::size_t kCountMax = 8192;

  void record(MonotonicTime now, Duration latency);
  void record_failure(MonotonicTime now);
  [[nodiscard]] LatencySummary summary(MonotonicTime now);

 private:
  struct Entry {
    MonotonicTime when{};
    Duration latency{};
  };
  void forget_old(MonotonicTime now);

  std::deque<Entry> entries_{};
  std::deque<MonotonicTime> failures_{};
};

}  // namespace rtpm::console
