#include "rtpm/device_evdev/evdev_driver.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "rtpm/rt/clock.hpp"

namespace rtpm::device_evdev {
namespace {

using driver::CommandMode;
using driver::ExchangeStatus;

// How long deactivate() waits for each thread.
constexpr Duration kReadPatience = std::chrono::milliseconds{20};
constexpr Duration kWritePatience = std::chrono::milliseconds{10};

constexpr double kLevelMax = std::numeric_limits<std::int16_t>::max();
constexpr double kRumbleMax = std::numeric_limits<std::uint16_t>::max();

/// `value` as a fraction of `full`, limited to the range `low` to 1; 0 if it is not finite.
double share(double value, double full, double low) noexcept {
  return std::isfinite(value) ? std::clamp(value / full, low, 1.0) : 0;
}

bool takes_joints(const Layout& layout) noexcept {
  return !layout.effects.empty() && layout.effects.front() == EffectKind::kConstant;
}

}  // namespace

EvdevDriver::EvdevDriver(Access access, Settings settings, std::string frame)
    : access_(std::move(access)), settings_(std::move(settings)), layout_(game_pad_layout()) {
  layout_.descriptor.frame = std::move(frame);
  for (const std::string* const word :
       {&settings_.serial, &settings_.path, &settings_.node, &settings_.name}) {
    if (layout_.descriptor.serial.empty()) layout_.descriptor.serial = *word;
  }
  if (layout_.descriptor.serial.empty()) layout_.descriptor.serial = "unknown";
  learn_channels();
}

EvdevDriver::~EvdevDriver() {
  EvdevDriver::deactivate();
}

void EvdevDriver::learn_channels() {
  const auto unit = choose(access_.list(), settings_, std::nullopt);
  if (!unit) return;
  const auto opened = access_.open(*unit, false);
  if (!opened) return;
  known_ = *unit;
  take_channels(make_layout((*opened)->capabilities(), settings_.scales));
  for (const std::string* const word : {&unit->path, &unit->serial}) {
    if (!word->empty()) layout_.descriptor.serial = *word;
  }
}

/// Keeps the serial number and the frame.
void EvdevDriver::take_channels(Layout layout) {
  layout.descriptor.serial = std::move(layout_.descriptor.serial);
  layout.descriptor.frame = std::move(layout_.descriptor.frame);
  layout_ = std::move(layout);
}

expected<void, SetupError> EvdevDriver::configure(const driver::DriverConfig& config) {
  if (config.period <= Duration{0}) {
    return setup_error("an input device's driver needs a period above zero", "", "set --rate");
  }
  deactivate();
  const auto unit = choose(access_.list(), settings_, known_);
  if (!unit) return unexpected{unit.error()};
  auto opened = access_.open(*unit, settings_.is_grabbed);
  if (!opened) return unexpected{opened.error()};
  const Capabilities& capabilities = (*opened)->capabilities();
  Layout layout = make_layout(capabilities, settings_.scales);
  if (!has_same_channels(layout, layout_)) {
    return setup_error(unit->node + " (" + unit->name + ") has other channels than described",
                       "it could not be read when this program started",
                       "start this program again");
  }
  // The descriptor, including the model, stays unchanged.
  layout.descriptor = layout_.descriptor;
  layout_ = std::move(layout);
  known_ = *unit;
  period_ = config.period;
  transport_ = std::move(*opened);
  accumulator_.emplace(layout_, capabilities, before_, transport_->now());
  effects_.emplace(*transport_, layout_.effects);
  return {};
}

expected<void, SetupError> EvdevDriver::activate() {
  if (!transport_ || is_active_) return setup_error("the input device's driver is not configured");
  const double gain = layout_.has_gain ? settings_.gain : -1;
  if (!layout_.effects.empty()) {
    const auto started = effects_->start(gain, layout_.has_autocenter);
    if (!started) return started;
  }
  unreadable_count_ = 0;
  seen_corrupt_count_ = accumulator_->state().corrupt_count;
  seen_lost_count_ = accumulator_->state().lost_count;
  seen_report_count_ = accumulator_->state().report_count;
  requests_.write({});
  applied_.write({});
  report(false);
  const auto started = start_threads();
  if (!started) {
    stop();
    return started;
  }
  is_active_ = true;
  return {};
}

expected<void, SetupError> EvdevDriver::start_threads() {
  const auto reading =
      reader_.start({.name = "evdev-read", .priority = 24'000}, [this] { return read_step(); });
  if (!reading || layout_.effects.empty()) return reading;
  return writer_.start({.name = "evdev-write", .priority = 23'000},
                       [this] { return write_step(); });
}

/// Ends the force before waiting for the reading thread.
void EvdevDriver::stop() noexcept {
  writer_.request_stop();
  wake_writer_.post();
  writer_.stop();
  if (effects_) effects_->stop();
  reader_.stop();
}

void EvdevDriver::report(bool is_gone) noexcept {
  const State& state = accumulator_->state();
  reports_.write({state, state.corrupt_count + unreadable_count_, is_gone});
}

bool EvdevDriver::read_step() noexcept {
  const ReadResult result = transport_->read(events_, kReadPatience);
  const MonotonicTime now = transport_->now();
  const std::size_t count = std::min(result.count, events_.size());
  for (std::size_t i = 0; i < count; ++i)
    accumulator_->apply(events_[i], now);
  if (result.status == ReadStatus::kCorrupt) ++unreadable_count_;
  report(result.status == ReadStatus::kGone);
  if (result.status != ReadStatus::kGone) limit_flood(std::max(count, std::size_t{1}));
  return result.status != ReadStatus::kGone;
}

/// Limits the CPU time spent on a device that sends too many events.
void EvdevDriver::limit_flood(std::size_t event_count) noexcept {
  const MonotonicTime now = rt::now();
  if (now - flood_since_ >= period_) {
    flood_since_ = now;
    flood_count_ = 0;
  }
  flood_count_ += event_count;
  if (flood_count_ < kEventsPerPeriodMax) return;
  rt::sleep_until(flood_since_ + std::min(period_, kReadPatience));
}

bool EvdevDriver::write_step() noexcept {
  const std::uint64_t request_count = requests_.count();
  const Request request = requests_.read().value_or(Request{});
  const MonotonicTime now = transport_->now();
  if (std::exchange(seen_request_count_, request_count) != request_count) requested_at_ = now;
  const bool is_stale = now - requested_at_ > request.hold;
  const EffectStatus status = effects_->update(is_stale ? Levels{} : request.levels, now);
  applied_.write({effects_->applied(), status});
  static_cast<void>(wake_writer_.wait_until(rt::now() + kWritePatience));
  return status != EffectStatus::kGone;
}

EvdevDriver::Request EvdevDriver::request_of(const driver::Command& command) const noexcept {
  Request request;
  request.hold = std::clamp(command.deadline - command.cycle_time, period_, kHoldMax);
  const bool is_effort = command.mode == CommandMode::kJointEffort && takes_joints(layout_);
  if (!is_effort && command.mode != CommandMode::kOutputs) return request;
  Levels& levels = request.levels;
  const auto level = [](double part) { return static_cast<std::int16_t>(part * kLevelMax); };
  if (is_effort) {
    const double effort_max = layout_.descriptor.joints.front().effort_max;
    const double effort = share(command.joints[0], effort_max, -1);
    levels.effort = level(settings_.scales.is_reversed ? -effort : effort);
  }
  std::size_t output = 0;
  const auto next = [&] { return share(command.outputs[output++], 1, 0); };
  for (const EffectKind kind : layout_.effects) {
    if (kind == EffectKind::kRumble) {
      levels.strong = static_cast<std::uint16_t>(next() * kRumbleMax);
      levels.weak = static_cast<std::uint16_t>(next() * kRumbleMax);
    }
    if (kind == EffectKind::kSpring) levels.spring = level(next());
    if (kind == EffectKind::kDamper) levels.damper = level(next());
  }
  return request;
}

ExchangeStatus EvdevDriver::exchange(const driver::Command& command,
                                     driver::Sample& sample) noexcept {
  if (!is_active_) return ExchangeStatus::kGone;
  const auto report = reports_.read();
  const auto applied = applied_.read();
  const bool is_gone =
      (report && report->is_gone) || (applied && applied->status == EffectStatus::kGone);
  requests_.write(is_gone ? Request{} : request_of(command));
  if (!layout_.effects.empty()) wake_writer_.post();
  if (is_gone) return ExchangeStatus::kGone;
  if (!report || !applied) return ExchangeStatus::kLate;
  if (std::exchange(seen_corrupt_count_, report->corrupt_count) != report->corrupt_count) {
    return ExchangeStatus::kCorrupt;
  }
  fill(sample, report->state, layout_, command.cycle_time);
  const bool has_moved =
      std::exchange(seen_report_count_, report->state.report_count) != report->state.report_count;
  const MonotonicTime time = has_moved ? report->state.time : command.cycle_time;
  sample.host_time = std::max(sample.host_time, std::min(time, command.cycle_time));
  if (std::exchange(seen_lost_count_, report->state.lost_count) != report->state.lost_count) {
    sample.faults.set(driver::Fault::kDeviceCorrupt);
  }
  fill_applied(command, *applied, sample);
  return ExchangeStatus::kOk;
}

void EvdevDriver::fill_applied(const driver::Command& command, const Applied& applied,
                               driver::Sample& sample) const noexcept {
  const Levels& levels = applied.levels;
  if (takes_joints(layout_)) {
    const double effort_max = layout_.descriptor.joints.front().effort_max;
    const double effort = levels.effort / kLevelMax * effort_max;
    sample.efforts_applied[0] = settings_.scales.is_reversed ? -effort : effort;
    const bool is_above =
        command.mode == CommandMode::kJointEffort && !(std::abs(command.joints[0]) <= effort_max);
    if (is_above) sample.faults.set(driver::Fault::kDeviceSaturated);
  }
  if (applied.status == EffectStatus::kRefused) {
    sample.faults.set(driver::Fault::kDeviceSaturated);
  }
  std::size_t output = 0;
  const auto put = [&](double part) {
    sample.outputs_applied[output++] = static_cast<float>(part);
  };
  for (const EffectKind kind : layout_.effects) {
    if (kind == EffectKind::kRumble) {
      put(levels.strong / kRumbleMax);
      put(levels.weak / kRumbleMax);
    }
    if (kind == EffectKind::kSpring) put(levels.spring / kLevelMax);
    if (kind == EffectKind::kDamper) put(levels.damper / kLevelMax);
  }
}

void EvdevDriver::deactivate() noexcept {
  stop();
  is_active_ = false;
  if (accumulator_) before_ = accumulator_->state();
  effects_.reset();
  accumulator_.reset();
  transport_.reset();
}

}  // namespace rtpm::device_evdev
