#include "servo.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "rtpm/models/evaluator.hpp"
#include "rtpm/rt/clock.hpp"

namespace rtpm::python {

/// The state of one servo, for its thread only.
class ServoState {
 public:
  gvd::Evaluator evaluator{};
  LoopFigures figures{};
};

expected<std::unique_ptr<Servo>, SetupError> Servo::start(SharedDevice device, Duration period,
                                                          Priority priority) {
  auto servo = std::unique_ptr<Servo>(new Servo(std::move(device), period, priority));
  servo->models_.write({});
  auto thread = rt::Thread::start({.name = "rtpm-servo", .priority = priority},
                                  [raw = servo.get()] { raw->run(); });
  if (!thread) return unexpected{std::move(thread.error())};
  servo->thread_ = unforked(std::make_unique<rt::Thread>(std::move(*thread)));
  return servo;
}

Servo::~Servo() {
  stop();
}

void Servo::stop() noexcept {
  is_stopping_.store(true, std::memory_order_release);
  thread_.reset();
}

LoopFigures Servo::figures() const noexcept {
  return figures_.read().value_or(LoopFigures{});
}

void Servo::run() noexcept {
  ServoState state;
  MonotonicTime next = rt::now();
  while (!is_stopping_.load(std::memory_order_acquire) && cycle(state)) {
    next += period_;
    rt::sleep_until(next);
    const Duration late = rt::now() - next;
    ++state.figures.cycle_count;
    state.figures.worst = std::max(state.figures.worst, late);
    if (late >= period_) {
      const auto skipped = late / period_;
      state.figures.late_count += static_cast<std::uint64_t>(skipped);
      next += skipped * period_;
    }
    figures_.write(state.figures);
  }
  is_running_.store(false, std::memory_order_release);
}

bool Servo::cycle(ServoState& state) noexcept {
  if (!device_->is_seen()) {
    ++state.figures.paused_count;
    return true;
  }
  const rpc::CallOptions options{.priority = priority_, .deadline = 10 * period_};
  const auto sample = device_->client().read(options);
  if (!sample) {
    ++state.figures.failed_count;
    return true;
  }
  if (const auto models = models_.read()) state.evaluator.set(*models);
  const auto forces = state.evaluator.evaluate(*sample);
  const auto done = device_->client().set_wrench(forces.wrench, options);
  if (!done && done.error() != gvd::DeviceOutcome::kSuperseded) ++state.figures.failed_count;
  return done || done.error() != gvd::DeviceOutcome::kNotHolder;
}

}  // namespace rtpm::python
