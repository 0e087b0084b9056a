#include "live/latency_window.hpp"

#include <algorithm>
#include <cmath>

namespace rtpm::console {
namespace {

constexpr double kBinsPerDecade = 8;

double us_of(Duration latency) {
  return static_cast<double>(latency.count()) / 1000;
}

/// The percentile by the nearest-rank method.
double percentile(const std::vector<double>& sorted, double percent) {
  if (sorted.empty()) return 0;
  // Absorbs rounding errors: 99.9 % of 1000 is 999.
  constexpr double kRounding = 1e-9;
  const double rank = std::ceil(percent / 100 * static_cast<double>(sorted.size()) - kRounding);
  return sorted[static_cast<std::size_t>(std::max(rank, 1.0)) - 1];
}

/// Bin 0 starts at 1 us and includes all lower values.
int bin_of(double us) {
  return us <= 1 ? 0 : static_cast<int>(std::floor(std::log10(us) * kBinsPerDecade));
}

}  // namespace

void LatencyWindow::record(MonotonicTime now, Duration latency) {
  entries_.push_back({now, latency});
  forget_old(now);
}

void LatencyWindow::record_failure(MonotonicTime now) {
  failures_.push_back(now);
  forget_old(now);
}

void LatencyWindow::forget_old(MonotonicTime now) {
  while (!entries_.empty() &&
         (now - entries_.front().when > kSpan || entries_.size() > kCountMax)) {
    entries_.pop_front();
  }
  while (!failures_.empty() && (now - failures_.front() > kSpan || failures_.size() > kCountMax)) {
    failures_.pop_front();
  }
}

LatencySummary LatencyWindow::summary(MonotonicTime now) {
  forget_old(now);
  LatencySummary summary{.count = entries_.size(), .failed_count = failures_.size()};
  if (entries_.empty()) return summary;
  std::vector<double> sorted;
  sorted.reserve(entries_.size());
  for (const Entry& entry : entries_)
    sorted.push_back(us_of(entry.latency));
  std::ranges::sort(sorted);
  summary.p50_us = percentile(sorted, 50);
  summary.p90_us = percentile(sorted, 90);
  summary.p99_us = percentile(sorted, 99);
  summary.p999_us = percentile(sorted, 99.9);
  summary.max_us = sorted.back();
  const int first = bin_of(sorted.front());
  for (int bin = first; bin <= bin_of(sorted.back()); ++bin) {
    summary.histogram.push_back(
        {std::pow(10, bin / kBinsPerDecade), std::pow(10, (bin + 1) / kBinsPerDecade), 0});
  }
  for (const double us : sorted)
    ++summary.histogram[static_cast<std::size_t>(bin_of(us) - first)].count;
  return summary;
}

}  // namespace rtpm::console
