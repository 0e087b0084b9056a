#include "samples.hpp"

#include <algorithm>
#include <cmath>

namespace rtpm::bench {
namespace {

double to_us(Duration duration) {
  return static_cast<double>(duration.count()) / 1000.0;
}

double percentile_of(std::vector<Duration> samples, double percent) {
  if (samples.empty()) return 0;
  const double share = percent / 100.0 * static_cast<double>(samples.size());
  // 99.9 % of 1000 is 999, also where binary fractions make it a little more.
  const auto rank = static_cast<std::size_t>(std::max(1.0, std::ceil(share - 1e-6)));
  const auto at = samples.begin() + static_cast<std::ptrdiff_t>(std::min(rank, samples.size()) - 1);
  std::nth_element(samples.begin(), at, samples.end());
  return to_us(*at);
}

}  // namespace

Samples::Samples(int round_count, std::size_t count_per_round)
    : rounds_(static_cast<std::size_t>(round_count)) {
  for (auto& round : rounds_) {
    // Touched as well as reserved: a page fault is not to be measured.
    round.resize(count_per_round);
    round.clear();
  }
}

std::size_t Samples::count() const noexcept {
  std::size_t count = 0;
  for (const auto& round : rounds_)
    count += round.size();
  return count;
}

double Samples::round_percentile(int round, double percent) const {
  return percentile_of(rounds_[static_cast<std::size_t>(round)], percent);
}

Percentiles Samples::percentiles() const {
  const auto median_at = [this](double percent) {
    std::vector<double> values;
    values.reserve(rounds_.size());
    for (int round = 0; round < round_count(); ++round) {
      values.push_back(round_percentile(round, percent));
    }
    return median_of(std::move(values));
  };
  std::vector<Duration> all;
  all.reserve(count());
  for (const auto& round : rounds_)
    all.insert(all.end(), round.begin(), round.end());
  return {.p50 = median_at(50),
          .p90 = median_at(90),
          .p99 = median_at(99),
          .p999 = median_at(99.9),
          .p9999 = percentile_of(all, 99.99),
          .max = percentile_of(all, 100)};
}

std::vector<double> Samples::all_us() const {
  std::vector<double> values;
  values.reserve(count());
  for (const auto& round : rounds_) {
    for (const Duration latency : round)
      values.push_back(to_us(latency));
  }
  return values;
}

Ratio ratio_at(const Samples& numerator, const Samples& denominator, double percent) {
  std::vector<double> ratios;
  for (int round = 0; round < numerator.round_count(); ++round) {
    const double below = denominator.round_percentile(round, percent);
    if (below > 0) ratios.push_back(numerator.round_percentile(round, percent) / below);
  }
  if (ratios.empty()) return {};
  const auto [low, high] = std::minmax_element(ratios.begin(), ratios.end());
  Ratio ratio{.median = median_of(ratios), .low = *low, .high = *high};
  ratio.rounds = std::move(ratios);
  return ratio;
}

double median_of(std::vector<double> values) {
  if (values.empty()) return 0;
  std::sort(values.begin(), values.end());
  const std::size_t middle = values.size() / 2;
  return values.size() % 2 == 1 ? values[middle] : (values[middle - 1] + values[middle]) / 2;
}

}  // namespace rtpm::bench
