#include "loop.hpp"

#include <algorithm>
#include <utility>

#include "rtpm/driver/vector.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/cycle_timer.hpp"
#include "rtpm/rt/memory.hpp"

namespace rtpm::servo {

expected<void, SetupError> Loop::start() {
  call_.priority = config_.thread.priority;
  call_.deadline = config_.deadline;
  auto thread = rt::Thread::start(config_.thread, [this] { run(); });
  if (!thread) return unexpected{thread.error()};
  thread_ = std::move(*thread);
  return {};
}

void Loop::run() noexcept {
  const rt::NoAllocationScope no_allocation;
  const MonotonicTime begin = rt::now() + config_.period;
  const MonotonicTime end = config_.duration > Duration{0} ? begin + config_.duration : kNever;
  const std::uint64_t last_cycle =
      config_.cycle_count_max > 0 ? config_.cycle_count_max : UINT64_MAX;
  rt::CycleTimer cycle(config_.period, begin);
  while (!is_stopping_.load(std::memory_order_relaxed) && !loss_ && cycle.due() < end &&
         statistics_.cycle_count < last_cycle) {
    cycle.wait();
    take_changes();
    run_cycle(cycle.due());
    cycle.finish();
  }
  statistics_.missed_count = cycle.overrun_count();
  is_over_.store(true, std::memory_order_release);
}

void Loop::take_changes() noexcept {
  while (const auto material = materials_.pop()) {
    proxy_.set_material(*material);
    // SYNC POINT material-changed: the next cycle renders it.
    change_count_.fetch_add(1, std::memory_order_release);
  }
}

void Loop::run_cycle(MonotonicTime due) noexcept {
  const MonotonicTime begun = rt::now();
  statistics_.lateness.record(begun - due);
  ++statistics_.cycle_count;

  const auto sample = device_.read(call_);
  const MonotonicTime read = rt::now();
  if (!sample) return fail(sample.error(), read);
  record_call(statistics_.read, read - begun);

  const scene::Touch touch = proxy_.touch(*sample);
  const auto force = render(*sample, touch, read);
  const MonotonicTime done = rt::now();
  if (!force) return fail(force.error(), done);
  failing_since_.reset();

  Duration latency = done - begun;
  statistics_.cycle.record(latency);
  if (latency <= kPaperCycle) ++statistics_.cycle_within_paper_count;
  static_cast<void>(cycles_.push(latency));  // If it is full, only the display misses the value.

  view_.sample = *sample;
  view_.force_newton = *force;
  view_.depth_m = touch.depth_m;
  view_.cycle_count = statistics_.cycle_count;
  view_.failed_count = statistics_.failed_count;
  if (view_.depth_m > 0) ++statistics_.contact_count;
  statistics_.force_newton_max = std::max(statistics_.force_newton_max, length(*force));
  statistics_.feel.record(touch, *sample);
  live_.write(view_);
  publish(*sample, touch, *force);
}

void Loop::publish(const driver::Sample& sample, scene::Touch touch,
                   const driver::Vector3& force_newton) noexcept {
  touch.force_newton = force_newton;
  scene::TouchReport report{sample.sequence, proxy_.scene(), touch};
  static_cast<void>(touches_.push(report));  // If it is full, only displays miss the report.
}

/// Commands the wall's force and returns it; with a local wall, returns the device's force.
expected<driver::Vector3, gvd::DeviceError> Loop::render(const driver::Sample& sample,
                                                         const scene::Touch& touch,
                                                         MonotonicTime now) noexcept {
  if (config_.is_local) return sample.wrench_applied.force_newton;
  const driver::Vector3 force = link_.pass(now, touch.force_newton);
  const MonotonicTime computed = rt::now();
  const auto sent = device_.set_force(force, call_);
  if (!sent) return unexpected{sent.error()};
  record_call(statistics_.command, rt::now() - computed);
  return force;
}

void Loop::record_call(LatencyHistogram& histogram, Duration latency) noexcept {
  histogram.record(latency);
  ++statistics_.call_count;
  if (latency <= kPaperCall) ++statistics_.call_within_paper_count;
}

void Loop::fail(gvd::DeviceError error, MonotonicTime now) noexcept {
  ++statistics_.call_count;
  ++statistics_.failed_count;
  view_.failed_count = statistics_.failed_count;
  live_.write(view_);
  if (!failing_since_) failing_since_ = now;
  // Without the lease every further call would fail; other errors may be transient.
  const bool is_hopeless = error == gvd::DeviceOutcome::kNotHolder;
  if (is_hopeless || now - *failing_since_ >= config_.patience) loss_ = error;
}

}  // namespace rtpm::servo
