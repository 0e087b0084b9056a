#include "rtpm/safety/filter.hpp"

#include <algorithm>

#include "vector.hpp"

namespace rtpm::gvd {
namespace {

using driver::Fault;

/// The longest elapsed time that rates and soft start use, so that a delayed thread does not jump
/// to full force.
constexpr Duration kElapsedMax = std::chrono::milliseconds{10};
constexpr std::optional<WrenchCommand> kNoCommand{};

}  // namespace

driver::Wrench SafetyFilter::step(MonotonicTime now, const std::optional<WrenchCommand>& offered,
                                  const Motion& motion) noexcept {
  if (last_step_) now = std::max(now, *last_step_);
  const Duration elapsed = last_step_ ? now - *last_step_ : Duration{0};
  last_step_ = now;
  faults_ = {};
  latch(offered, motion);
  if (is_latched()) {
    go_off();
    return output_;
  }
  // The next client's commands apply from the cycle after the first one without force.
  const bool is_changing_client = is_changing_client_;
  const std::optional<WrenchCommand>& newest = is_changing_client ? kNoCommand : offered;
  // A command of a client that lost the lease ends now.
  const MonotonicTime ends =
      newest ? std::min(newest->deadline, deadline_after(config_.hold_max, newest->received)) : now;
  if (now < ends) {
    watchdog_.follow(config_, ends);
    follow(*newest, std::min(elapsed, kElapsedMax), motion);
  } else {
    if (is_following_) {
      is_following_ = false;
      is_lost_ = newest.has_value();
      if (is_lost_) ++counters_.lost_count;
    }
    // A loss ends with a new command, or once no client may command.
    if (!newest) is_lost_ = false;
    const double share =
        watchdog_.fall(config_, now, ends, elapsed, newest.has_value(), motion, output_);
    static_cast<void>(Clamp::apply(config_, output_));
    soft_start_.fall(share);
    if (share <= 0) passivity_.restart();
  }
  if (is_lost_) faults_.set(Fault::kCommandLost);
  if (is_changing_client && is_off()) {
    is_changing_client_ = false;
    soft_start_.restart();
  }
  return output_;
}

void SafetyFilter::latch(const std::optional<WrenchCommand>& offered,
                         const Motion& motion) noexcept {
  if (offered && not_finite_.take(offered->wrench)) ++counters_.not_finite_count;
  if (offered && trip_.take(config_, motion)) ++counters_.tripped_count;
  if (not_finite_.is_set()) faults_.set(Fault::kCommandNotFinite);
  if (trip_.is_set()) faults_.set(Fault::kTooFast);
}

void SafetyFilter::note(bool has_acted, Fault fault, std::uint64_t& count) noexcept {
  if (!has_acted) return;
  faults_.set(fault);
  ++count;
}

void SafetyFilter::follow(const WrenchCommand& command, Duration elapsed,
                          const Motion& motion) noexcept {
  is_following_ = true;
  is_lost_ = false;
  driver::Wrench wanted = command.wrench;
  note(Clamp::apply(config_, wanted), Fault::kForceClamped, counters_.clamped_count);
  if (soft_start_.apply(config_, elapsed, wanted)) faults_.set(Fault::kSoftStart);
  note(SoftWall::apply(config_, motion, wanted), Fault::kSoftWall, counters_.wall_count);
  note(PowerLimit::apply(config_, motion, wanted), Fault::kPowerLimited,
       counters_.power_limited_count);
  note(passivity_.apply(config_, elapsed, motion, wanted), Fault::kBraked, counters_.braked_count);
  note(heat_.apply(config_, elapsed, motion, wanted), Fault::kHeatLimited,
       counters_.heat_limited_count);
  static_cast<void>(Clamp::apply(config_, wanted));
  note(RateLimit::approach(config_, elapsed, wanted, output_), Fault::kForceRateLimited,
       counters_.rate_limited_count);
}

void SafetyFilter::go_off() noexcept {
  output_ = {};
  soft_start_.restart();
  passivity_.restart();
  is_following_ = false;
  is_changing_client_ = false;
  is_lost_ = false;
  if (last_step_) watchdog_.go_off(*last_step_);
}

void SafetyFilter::recover() noexcept {
  not_finite_.recover();
  trip_.recover();
  reset();
}

void SafetyFilter::change_client() noexcept {
  is_changing_client_ = true;
}

void SafetyFilter::reset() noexcept {
  go_off();
  faults_ = {};
}

}  // namespace rtpm::gvd
