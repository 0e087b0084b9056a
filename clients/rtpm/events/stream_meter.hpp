#pragma once

#include <cstdint>
#include <optional>
#include <set>

#include "rtpm/base/histogram.hpp"
#include "rtpm/base/time.hpp"

namespace rtpm::tool {

/// Rate, jitter and loss of one source's events, from their sequence numbers and origin times
/// alone. So a slow or delayed reader tells the same as a quick one.
/// @threads  one
class StreamMeter {
 public:
  /// @param sequence   from 1
  /// @param latency    from the origin to the hub's sending
  void add(std::uint64_t sequence, MonotonicTime origin, Duration latency);

  [[nodiscard]] std::uint64_t count() const noexcept { return count_; }  ///< Without duplicates.
  [[nodiscard]] std::uint64_t lost_count() const noexcept { return missing_.size() + given_up_; }
  [[nodiscard]] std::uint64_t duplicate_count() const noexcept { return duplicate_count_; }
  [[nodiscard]] std::uint64_t late_count() const noexcept {
    return late_count_;
  }  ///< Out of order.
  [[nodiscard]] std::uint64_t restart_count() const noexcept { return restart_count_; }
  /// Origins that went back although the sequence went on.
  [[nodiscard]] std::uint64_t clock_jump_count() const noexcept { return clock_jump_count_; }

  /// As the source sent: also what was lost counts. 0 until there are two.
  [[nodiscard]] double rate_hz() const noexcept;
  /// Of the time between two consecutive events: how far it was from the mean one.
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

  static constexpr std::size_t kMissingMax = 100'000;  ///< That may still come.

  std::uint64_t count_ = 0;
  std::uint64_t duplicate_count_ = 0;
  std::uint64_t late_count_ = 0;
  std::uint64_t restart_count_ = 0;
  std::uint64_t clock_jump_count_ = 0;
  std::uint64_t given_up_ = 0;  ///< Missing ones beyond kMissingMax.
  std::set<std::uint64_t> missing_{};
  std::uint64_t newest_ = 0;
  MonotonicTime newest_origin_{};
  /// Over the steps forward of all lives of the source.
  std::uint64_t step_count_ = 0;
  Duration step_time_{0};
  /// Of intervals between consecutive events.
  std::uint64_t interval_count_ = 0;
  Duration interval_min_ = Duration::max();
  Duration interval_max_{0};
  long double interval_sum_ns_ = 0;
  long double interval_square_sum_ns_ = 0;
  LatencyHistogram latency_{};
};

}  // namespace rtpm::tool
