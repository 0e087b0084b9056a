#include "follow_meter.hpp"

#include <cmath>

namespace rtpm::media {

void FollowMeter::command(double target_s, MonotonicTime now) noexcept {
  if (target_s < 0 || target_s == last_target_s_) return;
  last_target_s_ = target_s;
  targets_[target_count_ % kTargetCountMax] = {target_s, now};
  ++target_count_;
  if (target_count_ - done_count_ > kTargetCountMax) done_count_ = target_count_ - kTargetCountMax;
}

void FollowMeter::show(double position_s, double frame_s, MonotonicTime now) noexcept {
  if (target_count_ > 0 && shown_s_ >= 0) {
    const double way_s = position_s - shown_s_;
    (way_s > 0 ? forwards_s_ : backwards_s_) += std::abs(way_s);
  }
  shown_s_ = position_s;
  for (std::uint64_t i = done_count_; i < target_count_; ++i) {
    const Target& target = targets_[i % kTargetCountMax];
    if (std::abs(target.position_s - position_s) > frame_s / 2) continue;
    followed_.record(now - target.commanded);
    done_count_ = i + 1;
    return;
  }
}

}  // namespace rtpm::media
