#include "rtpm/base/histogram.hpp"

#include <algorithm>
#include <bit>
#include <cmath>

namespace rtpm::inline base {

// Below 2^kSubBits each ns has its own bucket; above, each power of two has kSubCount buckets.
int LatencyHistogram::bucket_of(std::uint64_t ns) noexcept {
  if (ns < kSubCount) return static_cast<int>(ns);
  const int magnitude = static_cast<int>(std::bit_width(ns)) - 1 - kSubBits;
  if (magnitude >= kMagnitudes) return kBucketCount - 1;
  const int sub = static_cast<int>(ns >> magnitude) - kSubCount;
  return kSubCount * (magnitude + 1) + sub;
}

std::uint64_t LatencyHistogram::upper_end_of(int bucket) noexcept {
  if (bucket < kSubCount) return static_cast<std::uint64_t>(bucket);
  const int magnitude = bucket / kSubCount - 1;
  const auto sub = static_cast<std::uint64_t>(bucket % kSubCount) + kSubCount;
  return ((sub + 1) << magnitude) - 1;
}

void LatencyHistogram::record(Duration latency) noexcept {
  const Duration sample = std::max(latency, Duration{0});
  ++buckets_[static_cast<std::size_t>(bucket_of(static_cast<std::uint64_t>(sample.count())))];
  ++count_;
  sum_ += static_cast<std::uint64_t>(sample.count());
  min_ = std::min(min_, sample);
  max_ = std::max(max_, sample);
}

Duration LatencyHistogram::percentile(double percent) const noexcept {
  if (count_ == 0) return Duration{0};
  const double share = std::clamp(percent, 0.0, 100.0) / 100.0;
  const auto wanted = std::max<std::uint64_t>(
      1, static_cast<std::uint64_t>(std::ceil(share * static_cast<double>(count_))));
  std::uint64_t seen = 0;
  for (int bucket = 0; bucket < kBucketCount; ++bucket) {
    seen += buckets_[static_cast<std::size_t>(bucket)];
    if (seen >= wanted) {
      return std::min(max_, Duration{static_cast<Duration::rep>(upper_end_of(bucket))});
    }
  }
  return max_;
}

}  // namespace rtpm::inline base
