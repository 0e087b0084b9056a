#pragma once

#include <cstdint>
#include <optional>
#include <set>

#include "rtpm/base/histogram.hpp"
#include "rtpm/base/time.hpp"

namespace rtpm::tool {

/// Measures rate, jitter and loss of one source's events, only from their sequence numbers and
/// origin times. So a slow or delayed reader gets the same result as a fast one.
/// @threads  one
class StreamMeter {
 public:
  /// @param sequence   from 1
  /// @param latency    from the origin until the hub sent it
  void add(std::uint64_t sequence, MonotonicTime origin, Duration latency);

  /// The number of events, without duplicates.
  [[nodiscard]] std::uint64_t count() const noexcept { return count_; }
  [[nodiscard]] std::uint64_t lost_count() const noexcept { return missing_.size() + given_up_; }
  [[nodiscard]] std::uint64_t duplicate_count() const noexcept { return duplicate_count_; }
  /// The number of events that arrived out of order.
  [[nodiscard]] std::uint64_t late_count() const noexcept { return late_count_; }
  [[nodiscard]] std::uint64_t restart_count() const noexcept { return restart_count_; }
  /// How often origin times went back although the sequence advanced.
  [[nodiscard]] std::uint64_t clock_jump_count() const noexcept { return clock_jump_count_; }

  /// The source's sending rate, including lost events; 0 until there are two events.
  [[nodiscard]] double rate_hz() const noexcept;
  /// How much the time between consecutive events deviates from its mean.
  struct Jitter {
    Duration mean{};  ///< The mean time between events.
    double rms_ns = 0;
    Duration max{};
  };
  [[nodiscard]] std::optional<Jitter> jitter() const noexcept;
  [[nodiscard]] const LatencyHistogram& latency() const noexcept { return latency_; }

 private:
  void begin(std::uint64_t sequence, MonotonicTime origin) noexcept;
  void go_on(std::uint64_t sequence, MonotonicTime origin);
  void add_interval(Duration interval) noexcept;

  /// The most missing events that are tracked.
  static constexpr std::size_t kMissingMax = 100'000;

  std::uint64_t count_ = 0;
  std::uint64_t duplicate_count_ = 0;
  std::uint64_t late_count_ = 0;
  std::uint64_t restart_count_ = 0;
  std::uint64_t clock_jump_count_ = 0;
  std::uint64_t given_up_ = 0;  ///< Missing events beyond kMissingMax.
  std::set<std::uint64_t> missing_{};
  std::uint64_t newest_ = 0;
  MonotonicTime newest_origin_{};
  /// Steps forward, over all restarts of the source.
  std::uint64_t step_count_ = 0;
  Duration step_time_{0};
  /// Intervals between consecutive events.
  std::uint64_t interval_count_ = 0;
  Duration interval_min_ = Duration::max();
  Duration interval_max_{0};
  long double interval_sum_ns_ = 0;
  long double interval_square_sum_ns_ = 0;
  LatencyHistogram latency_{};
};

}  // namespace rtpm::tool
