#pragma once

#include <cstdint>

#include "rtpm/base/time.hpp"

namespace rtpm::rt {

/// Estimates whether an idle thread should spin for a while or block at once: spinning pays if the
/// next work often arrives within the spin time. That is known even after a block, so no trial
/// spins are needed. Pure arithmetic on the times passed in.
/// @threads  one
/// @realtime alloc-free, a few ns
class SpinEstimator {
 public:
  /// Call when work ended: returns whether to spin for up to `spin` from `now`.
  [[nodiscard]] bool on_idle(MonotonicTime now, Duration spin) noexcept {
    idle_begin_ = now;
    idle_end_ = now + spin;
    return score_ >= kWorth;
  }
  /// Records that the last work arrived at `when`. Counts only once; ignored if that was before
  /// on_idle().
  void on_work(MonotonicTime when) noexcept {
    if (when <= idle_begin_) return;
    if (when < idle_end_) {
      score_ += (kSure - score_) / 4;
    } else {
      score_ -= score_ / 8;
    }
    idle_begin_ = kNever;
  }

 private:
  static constexpr std::uint32_t kSure = 1024;
  /// With a lower score the thread blocks at once: after sixteen long pauses in a row, or five
  /// after the first short pause in a while. A useless spin costs some tens of microseconds of CPU;
  /// a useless block costs as much latency.
  static constexpr std::uint32_t kWorth = kSure / 8;

  MonotonicTime idle_begin_ = kNever;
  MonotonicTime idle_end_ = kNever;
  std::uint32_t score_ = kSure;
};

}  // namespace rtpm::rt
