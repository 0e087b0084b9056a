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

/// Every latency of one contender, kept round by round. Samples are kept whole, not in a histogram,
/// whose bucket width would blur a ratio of 1.1.
class Samples {
 public:
  /// Reserves memory, so that add() allocates nothing.   Set-up only.
  Samples(int round_count, std::size_t count_per_round);
  Samples(Samples&&) noexcept = default;
  Samples& operator=(Samples&&) noexcept = default;

  void begin_round(int round) noexcept { round_ = static_cast<std::size_t>(round); }
  /// Marks the current round as disturbed: only p99.99 and the maximum use it, as long as a third
  /// of the rounds is undisturbed.
  void note_disturbed(bool was_disturbed) noexcept {
    if (was_disturbed) disturbed_[round_] = true;
  }
  /// RT: alloc-free within the reserved memory.
  void add(Duration latency) { rounds_[round_].push_back(latency); }

  /// Removes all samples, and keeps the memory.
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
  /// p50 to p99.9 are the middles of the stretches' own values; p99.99 and the maximum, for which a
  /// stretch is too short, come from all samples together.
  [[nodiscard]] Percentiles percentiles() const;
  /// Every latency in the order of adding, in microseconds.
  [[nodiscard]] std::vector<double> all_us() const;

 private:
  std::vector<std::vector<Duration>> rounds_;
  std::vector<bool> disturbed_;
  std::size_t round_ = 0;
};

/// The rounds of a run, by number, that one value of a percentile rests on: as many consecutive
/// ones as it takes to have ten samples beyond the percentile. A median gets a value per round, a
/// p99.9 a value per ten thousand samples.
using Stretch = std::vector<int>;

/// The rounds of two interleaved contenders that figures rest on: those disturbed for neither, if
/// they are at least a third of all; otherwise all.
[[nodiscard]] Stretch rounds_that_count(const Samples& one, const Samples& other);
/// The number of rounds that were disturbed for either contender.
[[nodiscard]] int disturbed_round_count(const Samples& one, const Samples& other);

/// The stretches of two contenders' turns: the same for both, of the rounds that count. A single
/// stretch if there are too few samples for several.
[[nodiscard]] std::vector<Stretch> stretches_of(const Samples& one, const Samples& other,
                                                double percent);

/// The comparison of two contenders of one run at one percentile: the middle of the stretches'
/// ratios, and the interval in which it lies with 95 % confidence, found by drawing the rounds
/// again and again. With a single round, the interval is the ratio itself: its spread is unknown.
struct Ratio {
  double middle = 0;
  double low = 0;
  double high = 0;
  std::vector<double> stretches{};  ///< The ratios themselves.
};
[[nodiscard]] Ratio ratio_at(const Samples& numerator, const Samples& denominator, double percent);

/// The mean of the middle half of the values, which no outlier moves; 0 if there are none. A median
/// would jump where the values form two clusters, as they do where memory lies well or badly in the
/// caches from one start of the servers to the next. With three values it is the median.
[[nodiscard]] double middle_of(std::vector<double> values);

}  // namespace rtpm::bench
