#include "figures/samples.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>

namespace rtpm::bench {
namespace {

double to_us(Duration duration) {
  return static_cast<double>(duration.count()) / 1000.0;
}

double percentile_of(std::vector<Duration> samples, double percent) {
  if (samples.empty()) return 0;
  const double share = percent / 100.0 * static_cast<double>(samples.size());
  // 99.9 % of 1000 is 999, even where binary fractions make it a little more.
  const auto rank = static_cast<std::size_t>(std::max(1.0, std::ceil(share - 1e-6)));
  const auto at = samples.begin() + static_cast<std::ptrdiff_t>(std::min(rank, samples.size()) - 1);
  std::nth_element(samples.begin(), at, samples.end());
  return to_us(*at);
}

/// The samples needed beyond a percentile: with fewer, one or two outliers decide it.
constexpr double kBeyondMin = 10;
constexpr int kDrawCount = 200;

Stretch all_rounds(const Samples& one, const Samples& other) {
  Stretch all(static_cast<std::size_t>(std::min(one.round_count(), other.round_count())));
  std::iota(all.begin(), all.end(), 0);
  return all;
}

bool is_disturbed(const Samples& one, const Samples& other, int round) {
  return one.is_disturbed(round) || other.is_disturbed(round);
}

double percentile_of(const Samples& samples, const Stretch& stretch, double percent) {
  std::vector<Duration> together;
  for (const int round : stretch) {
    const auto latencies = samples.of_round(round);
    together.insert(together.end(), latencies.begin(), latencies.end());
  }
  return percentile_of(std::move(together), percent);
}

/// Leaves out stretches whose denominator is zero.
std::vector<double> ratios_of(const Samples& numerator, const Samples& denominator,
                              const std::vector<Stretch>& stretches, double percent) {
  std::vector<double> ratios;
  for (const Stretch& stretch : stretches) {
    const double below = percentile_of(denominator, stretch, percent);
    if (below > 0) ratios.push_back(percentile_of(numerator, stretch, percent) / below);
  }
  return ratios;
}

/// Sets the interval that holds the middle of the ratios with 95 % confidence, by bootstrap: draws
/// the rounds at random with repetition, and takes the middle of each draw.
void find_interval(Ratio& ratio, const Samples& numerator, const Samples& denominator,
                   const std::vector<Stretch>& stretches, double percent) {
  Stretch rounds;
  for (const Stretch& stretch : stretches)
    rounds.insert(rounds.end(), stretch.begin(), stretch.end());
  const bool is_by_round = rounds.size() == ratio.stretches.size();
  // A fixed seed, so that equal samples give equal intervals.
  std::minstd_rand random;  // NOLINT(cert-msc32-c,cert-msc51-cpp)
  std::uniform_int_distribution<std::size_t> draw(0, rounds.size() - 1);
  std::vector<double> middles;
  for (int i = 0; i < kDrawCount; ++i) {
    std::vector<double> ratios;
    if (is_by_round) {
      for (std::size_t k = 0; k < rounds.size(); ++k)
        ratios.push_back(ratio.stretches[draw(random)]);
    } else {
      std::vector<Stretch> drawn = stretches;
      for (Stretch& stretch : drawn) {
        for (int& round : stretch)
          round = rounds[draw(random)];
      }
      ratios = ratios_of(numerator, denominator, drawn, percent);
    }
    if (!ratios.empty()) middles.push_back(middle_of(std::move(ratios)));
  }
  if (middles.empty()) return;
  std::ranges::sort(middles);
  ratio.low = middles[middles.size() / 40];
  ratio.high = middles[middles.size() - 1 - middles.size() / 40];
}

}  // namespace

Samples::Samples(int round_count, std::size_t count_per_round)
    : rounds_(static_cast<std::size_t>(round_count)),
      disturbed_(static_cast<std::size_t>(round_count), false) {
  for (auto& round : rounds_) {
    // Touched as well as reserved, so that no page fault is measured.
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

std::vector<double> Samples::stretch_percentiles(double percent) const {
  std::vector<double> values;
  for (const Stretch& stretch : stretches_of(*this, *this, percent))
    values.push_back(percentile_of(*this, stretch, percent));
  return values;
}

Percentiles Samples::percentiles() const {
  const auto middle_at = [this](double percent) { return middle_of(stretch_percentiles(percent)); };
  std::vector<Duration> all;
  all.reserve(count());
  for (const auto& round : rounds_)
    all.insert(all.end(), round.begin(), round.end());
  return {.p50 = middle_at(50),
          .p90 = middle_at(90),
          .p99 = middle_at(99),
          .p999 = middle_at(99.9),
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

Stretch rounds_that_count(const Samples& one, const Samples& other) {
  Stretch all = all_rounds(one, other);
  Stretch rounds = all;
  std::erase_if(rounds, [&](int round) { return is_disturbed(one, other, round); });
  return 3 * rounds.size() >= all.size() ? rounds : all;
}

int disturbed_round_count(const Samples& one, const Samples& other) {
  return static_cast<int>(std::ranges::count_if(
      all_rounds(one, other), [&](int round) { return is_disturbed(one, other, round); }));
}

std::vector<Stretch> stretches_of(const Samples& one, const Samples& other, double percent) {
  const auto count_min =
      static_cast<std::size_t>(std::ceil(kBeyondMin / (1 - percent / 100) - 1e-6));
  std::vector<Stretch> stretches;
  Stretch next;
  std::size_t count = 0;
  for (const int round : rounds_that_count(one, other)) {
    next.push_back(round);
    count += std::min(one.of_round(round).size(), other.of_round(round).size());
    if (count < count_min) continue;
    stretches.push_back(std::move(next));
    next.clear();
    count = 0;
  }
  // The remainder at the end joins the stretch before it.
  if (stretches.empty()) {
    if (!next.empty()) stretches.push_back(std::move(next));
  } else {
    stretches.back().insert(stretches.back().end(), next.begin(), next.end());
  }
  return stretches;
}

Ratio ratio_at(const Samples& numerator, const Samples& denominator, double percent) {
  const std::vector<Stretch> stretches = stretches_of(numerator, denominator, percent);
  Ratio ratio{.stretches = ratios_of(numerator, denominator, stretches, percent)};
  if (ratio.stretches.empty()) return {};
  ratio.middle = ratio.low = ratio.high = middle_of(ratio.stretches);
  find_interval(ratio, numerator, denominator, stretches, percent);
  return ratio;
}

double middle_of(std::vector<double> values) {
  if (values.empty()) return 0;
  std::ranges::sort(values);
  const auto cut = static_cast<std::ptrdiff_t>((values.size() + 1) / 4);
  const auto count = static_cast<std::ptrdiff_t>(values.size()) - 2 * cut;
  return std::accumulate(values.begin() + cut, values.end() - cut, 0.0) /
         static_cast<double>(count);
}

}  // namespace rtpm::bench
