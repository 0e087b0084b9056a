#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "rtpm/base/time.hpp"

namespace rtpm::bench {

/// The points of a distribution that are reported, in microseconds.
struct Percentiles {
  double p50 = 0;
  double p90 = 0;
  double p99 = 0;
  double p999 = 0;
  double p9999 = 0;
  double max = 0;
};

/// Every latency of one contender, kept round by round. They are kept whole, not in a histogram:
/// a ratio of 1.1 is nothing to blur by a bucket's width.
class Samples {
 public:
  /// Makes room, so that add() allocates nothing.   Set-up only.
  Samples(int round_count, std::size_t count_per_round);
  Samples(Samples&&) noexcept = default;
  Samples& operator=(Samples&&) noexcept = default;

  void begin_round(int round) noexcept { round_ = static_cast<std::size_t>(round); }
  /// RT: alloc-free within the room made.
  void add(Duration latency) { rounds_[round_].push_back(latency); }

  /// Forgets all, and keeps the room.
  void clear() noexcept {
    for (auto& round : rounds_)
      round.clear();
  }
  [[nodiscard]] std::span<const Duration> of_round(int round) const {
    return rounds_[static_cast<std::size_t>(round)];
  }

  [[nodiscard]] std::size_t count() const noexcept;
  [[nodiscard]] int round_count() const noexcept { return static_cast<int>(rounds_.size()); }

  /// The latency that `percent` of a round's samples do not exceed, in microseconds; 0 without any.
  [[nodiscard]] double round_percentile(int round, double percent) const;
  /// p50 to p99.9 are the medians of the rounds' own; p99.99 and the maximum, for which a round is
  /// too short, are of all samples together.
  [[nodiscard]] Percentiles percentiles() const;
  /// Every latency in the order in which they were added, in microseconds.
  [[nodiscard]] std::vector<double> all_us() const;

 private:
  std::vector<std::vector<Duration>> rounds_;
  std::size_t round_ = 0;
};

/// How two contenders of one run compare at one percentile: the median of the rounds' ratios, and
/// the smallest and largest of them, which tell how far to trust it.
struct Ratio {
  double median = 0;
  double low = 0;
  double high = 0;
  std::vector<double> rounds{};  ///< The ratios themselves.
};
[[nodiscard]] Ratio ratio_at(const Samples& numerator, const Samples& denominator, double percent);

/// The middle value, or the mean of the two in the middle; 0 of nothing.
[[nodiscard]] double median_of(std::vector<double> values);

}  // namespace rtpm::bench
