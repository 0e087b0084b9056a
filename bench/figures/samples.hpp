#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
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
  /// Marks the current round as disturbed: only p99.99 and the maximum use it, as long as a third
  /// of the rounds is undisturbed.
  void note_disturbed(bool was_disturbed) noexcept {
    if (was_disturbed) disturbed_[round_] = true;
  }
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
  [[nodiscard]] bool is_disturbed(int round) const {
    return disturbed_[static_cast<std::size_t>(round)];
  }

  /// The latency that `percent` of each stretch's samples do not exceed, in microseconds.
  [[nodiscard]] std::vector<double> stretch_percentiles(double percent) const;
  /// p50 to p99.9 are the middles of the stretches' own; p99.99 and the maximum, for which a
  /// stretch is too short, are of all samples together.
  [[nodiscard]] Percentiles percentiles() const;
  /// Every latency in the order in which they were added, in microseconds.
  [[nodiscard]] std::vector<double> all_us() const;

 private:
  std::vector<std::vector<Duration>> rounds_;
  std::vector<bool> disturbed_;
  std::size_t round_ = 0;
};

/// Rounds of a run, by their numbers, that one value of a percentile rests on: as many, side by
/// side, as it takes to have ten samples beyond the percentile. A median is told round by round, a
/// p99.9 of ten thousand samples at a time.
using Stretch = std::vector<int>;

/// The rounds of two interleaved contenders that figures rest on: those disturbed for neither, if
/// they are a third of all; else all.
[[nodiscard]] Stretch rounds_that_count(const Samples& one, const Samples& other);
/// The number of rounds that were disturbed for either contender.
[[nodiscard]] int disturbed_round_count(const Samples& one, const Samples& other);

/// The stretches of what two contenders did by turns: the same for both, of the rounds that count.
/// One alone, if there are too few samples for several.
[[nodiscard]] std::vector<Stretch> stretches_of(const Samples& one, const Samples& other,
                                                double percent);

/// How two contenders of one run compare at one percentile: the middle of the stretches' ratios,
/// and the interval in which it lies with 95 % confidence, found by drawing the rounds again and
/// again. Of a single round, the interval is the ratio itself: nothing is known of it.
struct Ratio {
  double middle = 0;
  double low = 0;
  double high = 0;
  std::vector<double> stretches{};  ///< The ratios themselves.
};
[[nodiscard]] Ratio ratio_at(const Samples& numerator, const Samples& denominator, double percent);

/// The mean of the middle half of the values, which no wild one moves; 0 of nothing. A median would
/// jump where the values come in two heaps, as they do where memory lies well or badly in the
/// caches from one start of the servers to the next. Of three values it is the median.
[[nodiscard]] double middle_of(std::vector<double> values);

}  // namespace rtpm::bench
