#pragma once

#include <cstdint>

#include "rtpm/base/time.hpp"

namespace rtpm::rt {

/// Learns whether a thread that ran out of work had better spin a while or block at once: spinning
/// pays where the next work often comes within the time that it would spin for. That is known after
/// a block as well, so it takes no trials. Pure arithmetic on times that come in.
/// @threads  one
/// @realtime alloc-free, a few ns
class SpinEstimator {
 public:
  /// Work ended, and there is none: whether to spin for up to `spin` from `now`.
  [[nodiscard]] bool on_idle(MonotonicTime now, Duration spin) noexcept {
    idle_begin_ = now;
    idle_end_ = now + spin;
    return score_ >= kWorth;
  }
  /// The last work came at `when`: nothing new if that was before on_idle(). It counts once.
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
  /// Below it no pause is spun through: sixteen in a row were too long, or five after the first
  /// short one of a while. To spin in vain costs some tens of microseconds of a CPU; to block in
  /// vain costs as many of latency.
  static constexpr std::uint32_t kWorth = kSure / 8;

  MonotonicTime idle_begin_ = kNever;
  MonotonicTime idle_end_ = kNever;
  std::uint32_t score_ = kSure;
};

}  // namespace rtpm::rt
