#include "cycle.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "rtpm/driver/vector.hpp"
#include "rtpm/safety/finite.hpp"

namespace rtpm::gvd {
namespace {

using driver::CommandMode;
using driver::ExchangeStatus;
using driver::Fault;
using driver::Lifecycle;

template <class Value, std::size_t kCount>
bool is_whole(const std::array<Value, kCount>& values) noexcept {
  return std::ranges::all_of(values, [](Value value) { return std::isfinite(value); });
}

/// Whether every number is finite.
bool is_whole(const driver::Sample& sample) noexcept {
  const driver::Quaternion& turn = sample.pose.orientation;
  return is_finite(sample.pose.position_m) && is_finite(sample.twist.linear_m_per_s) &&
         is_finite(sample.twist.angular_rad_per_s) && is_finite(sample.wrench_applied) &&
         std::isfinite(turn.x) && std::isfinite(turn.y) && std::isfinite(turn.z) &&
         std::isfinite(turn.w) && is_whole(sample.joints) && is_whole(sample.joint_velocities) &&
         is_whole(sample.efforts_applied) && is_whole(sample.outputs_applied) &&
         is_whole(sample.analogs);
}

/// Life of the models' force, should the device's thread stop: ten cycles at 1 kHz.
constexpr Duration kModelHold = std::chrono::milliseconds{10};

/// A setpoint has one mode: a wrench goes before efforts, and both before nothing. A client's
/// motion goes before the models.
void add(const ModelForces& forces, driver::Setpoint& setpoint) noexcept {
  const bool is_idle = setpoint.mode == CommandMode::kOff || setpoint.mode == CommandMode::kOutputs;
  if (is_idle && forces.wrench != driver::Wrench{}) {
    setpoint.mode = CommandMode::kForce;
    setpoint.wrench = {};
  } else if (is_idle && forces.efforts != decltype(forces.efforts){}) {
    setpoint.mode = CommandMode::kJointEffort;
    setpoint.joints = {};
  }
  if (setpoint.mode == CommandMode::kForce) {
    setpoint.wrench.force_newton = sum(setpoint.wrench.force_newton, forces.wrench.force_newton);
  }
  if (setpoint.mode == CommandMode::kJointEffort) {
    for (std::size_t i = 0; i < forces.efforts.size(); ++i)
      setpoint.joints[i] += forces.efforts[i];
  }
}

template <class Request>
constexpr std::uint16_t number_of(Request request) noexcept {
  return static_cast<std::uint16_t>(static_cast<int>(request) + 1);
}

/// As a wrench that latches the filter's fault.
constexpr driver::Wrench kNotFinite{{std::numeric_limits<double>::quiet_NaN(), 0, 0}, {}};

driver::Wrench wrench_of(const driver::Setpoint& setpoint) noexcept {
  if (!is_finite(setpoint)) return kNotFinite;
  return setpoint.mode == driver::CommandMode::kForce ? setpoint.wrench : driver::Wrench{};
}

/// `what` is not 0.
constexpr std::uint32_t request_of(std::uint64_t lease, std::uint16_t what) noexcept {
  return std::uint32_t{Lease::serial_of(lease)} << 16 | what;
}

/// The pending request, if the holder left it: a former holder's is void. 0: none.
std::uint16_t take_request(std::atomic<std::uint32_t>& request, std::uint64_t holder) noexcept {
  if (request.load(std::memory_order_relaxed) == 0) return 0;
  const std::uint32_t taken = request.exchange(0, std::memory_order_acq_rel);
  const auto what = static_cast<std::uint16_t>(taken);
  return holder != Lease::kNobody && taken == request_of(holder, what) ? what : 0;
}

}  // namespace

void SuccessRate::record(bool is_good) noexcept {
  bool& slot = is_good_[count_ % kWindow];
  if (slot) --good_count_;
  slot = is_good;
  if (is_good) ++good_count_;
  ++count_;
}

float SuccessRate::share() const noexcept {
  const std::size_t known = std::min(count_, kWindow);
  return known == 0 ? 0.0F : static_cast<float>(good_count_) / static_cast<float>(known);
}

DeviceCycle::DeviceCycle(driver::Driver& driver, CycleConfig config, SipKey lease_key)
    : driver_(driver),
      config_(config),
      lease_(config_.lease, lease_key),
      limiter_(driver.describe()),
      safety_(config_.safety ? *config_.safety : SafetyConfig::for_device(driver.describe())),
      filter_(safety_),
      models_(driver.describe(), config_.period) {}

expected<void, SetupError> DeviceCycle::begin(MonotonicTime now) {
  retry_at_ = now;
  return open();
}

void DeviceCycle::begin_without(MonotonicTime now, const SetupError& error) {
  retry_at_ = now + config_.retry;
  lifecycle_.store(Lifecycle::kFault, std::memory_order_release);
  report(error.text() + " Trying to reach it again.");
}

expected<void, SetupError> DeviceCycle::open() {
  if (auto configured = driver_.configure({.period = config_.period}); !configured) {
    return configured;
  }
  if (auto activated = driver_.activate(); !activated) return activated;
  filter_.reset();
  bad_cycle_count_ = 0;
  lifecycle_.store(Lifecycle::kActive, std::memory_order_release);
  return {};
}

const DeviceCycle::HeldCommand* DeviceCycle::command_of(std::uint64_t holder) noexcept {
  if (const auto newest = mailbox_.take()) held_ = *newest;
  if (const auto what = take_request(release_request_, holder); what != 0) {
    if (what == number_of(Release::kRearm)) emergency_.rearm();
    if (what == number_of(Release::kRecover)) filter_.recover();
    // Commands before it belong to the fault or the stop.
    held_ = {};
    models_.drop_before_release();
  }
  if (emergency_.is_set()) {
    held_ = {};
    models_.drop();
    filter_.reset();
    sample_.faults.set(Fault::kEmergencyStop);
  }
  return holder == Lease::kNobody || held_.lease != holder ? nullptr : &held_;
}

const DeviceCycle::HeldCommand* DeviceCycle::with_models(MonotonicTime now, std::uint64_t holder,
                                                         const HeldCommand* newest) noexcept {
  models_.take_for(holder);
  // A number that is not finite latches the filter's fault, whatever the models.
  const bool is_finite_command = newest == nullptr || is_finite(newest->wrench.wrench);
  if (models_.is_empty() || !is_finite_command) return newest;
  const bool is_live = newest != nullptr && now < newest->wrench.deadline;
  rendered_ = is_live ? *newest : HeldCommand{.lease = holder};
  driver::Setpoint& setpoint = rendered_.setpoint;
  if (setpoint.mode == CommandMode::kOff) setpoint.outputs = limiter_.safe_outputs();
  add(models_.evaluate(sample_), setpoint);
  const Duration hold = std::max(kModelHold, 2 * config_.period);
  rendered_.wrench = {wrench_of(setpoint), now, now + hold};
  return &rendered_;
}

driver::Command DeviceCycle::filter(MonotonicTime now, const HeldCommand* newest) noexcept {
  driver::Command command;
  const driver::Wrench wrench =
      filter_.step(now, newest != nullptr ? std::optional(newest->wrench) : std::nullopt,
                   {sample_.pose.position_m, sample_.twist, sample_.wrench_applied});
  command.outputs = limiter_.safe_outputs();
  if (filter_.is_following()) {
    static_cast<driver::Setpoint&>(command) = limiter_.limit(newest->setpoint);
    efforts_ = {};
    if (command.mode == CommandMode::kJointEffort) efforts_ = command.joints;
  }
  // Efforts fall like a wrench when commands stop; motion and outputs stop at once.
  if (efforts_ != decltype(efforts_){} && filter_.gain() > 0) {
    command.mode = CommandMode::kJointEffort;
    for (std::size_t i = 0; i < efforts_.size(); ++i)
      command.joints[i] = efforts_[i] * filter_.gain();
  } else {
    efforts_ = {};
  }
  command.wrench = wrench;
  if (wrench != driver::Wrench{}) command.mode = CommandMode::kForce;
  command.sequence = counters_.cycle_count;
  command.cycle_time = now;
  command.deadline = filter_.zero_at();
  flight_.has_command = newest != nullptr;
  if (newest != nullptr) flight_.received = newest->wrench.wrench;
  flight_.applied = wrench;
  return command;
}

void DeviceCycle::run(MonotonicTime now, std::uint32_t missed_count) noexcept {
  ++counters_.cycle_count;
  counters_.missed_count += missed_count;
  const std::uint64_t holder = lease_.step(now);
  if (std::exchange(last_holder_, holder) != holder) filter_.change_client();
  sample_.faults = {};
  const HeldCommand* const newest = with_models(now, holder, command_of(holder));
  if (const auto what = take_request(transition_request_, holder); what != 0) {
    wanted_ = static_cast<Transition>(what - 1);
  }
  if (lifecycle() != Lifecycle::kActive) {
    rest(now);
    return;
  }

  const driver::Faults stop_faults = sample_.faults;
  const ExchangeStatus status = exchange(filter(now, newest));
  sample_.faults.set(stop_faults);
  if (status == ExchangeStatus::kGone || bad_cycle_count_ > config_.bad_cycle_max) {
    lose();
    retry_at_ = now + config_.retry;
  }
  sample_.faults.set(filter_.faults());
  const bool has_command = newest != nullptr && now < newest->wrench.deadline;
  success_.record(status == ExchangeStatus::kOk && missed_count == 0 &&
                  (holder == Lease::kNobody || has_command));
  publish(now);
}

ExchangeStatus DeviceCycle::exchange(const driver::Command& command) noexcept {
  // The driver writes to a copy, so that a failed exchange changes nothing.
  driver::Sample taken = sample_;
  ExchangeStatus status = driver_.exchange(command, taken);
  if (status == ExchangeStatus::kOk && !is_whole(taken)) status = ExchangeStatus::kCorrupt;
  switch (status) {
    case ExchangeStatus::kOk:
      sample_ = taken;
      bad_cycle_count_ = 0;
      break;
    case ExchangeStatus::kLate:
      sample_.faults.set(Fault::kDeviceLate);
      ++counters_.late_count;
      ++bad_cycle_count_;
      break;
    case ExchangeStatus::kCorrupt:
      sample_.faults.set(Fault::kDeviceCorrupt);
      ++counters_.corrupt_count;
      ++bad_cycle_count_;
      break;
    case ExchangeStatus::kGone:
      break;
  }
  return status;
}

void DeviceCycle::lose() noexcept {
  ++counters_.gone_count;
  is_to_close_ = true;
  filter_.reset();
  // The holder must acquire the lease again for the returning device.
  lease_.revoke();
  lifecycle_.store(Lifecycle::kFault, std::memory_order_release);
  sample_.faults.set(Fault::kDeviceGone);
  sample_.wrench_applied = {};
  sample_.twist = {};
}

void DeviceCycle::rest(MonotonicTime now) noexcept {
  // The filter keeps running, so that a latched fault shows and soft start begins at zero.
  static_cast<void>(filter_.step(now, std::nullopt));
  models_.drop();
  sample_.faults.set(filter_.faults());
  if (lifecycle() == Lifecycle::kFault) {
    sample_.faults.set(Fault::kDeviceGone);
    success_.record(false);
  }
  publish(now);
}

void DeviceCycle::publish(MonotonicTime now) noexcept {
  sample_.sequence = counters_.cycle_count;
  sample_.success_rate = success_.share();
  sample_.lifecycle = lifecycle();
  published_at_.store(now, std::memory_order_relaxed);
  published_.write(sample_);
  counters_.safety = filter_.counters();
  counters_.lease_expired_count = lease_.expired_count();
  counters_.lease_idle_count = lease_.idle_count();
  counters_.lease_taken_over_count = lease_.taken_over_count();
  published_counters_.write(counters_);
  record_flight(now);
  show_observer(now);
}

void DeviceCycle::record_flight(MonotonicTime now) noexcept {
  flight_.cycle = counters_.cycle_count;
  flight_.time = now;
  flight_.position_m = sample_.pose.position_m;
  flight_.velocity_m_per_s = sample_.twist.linear_m_per_s;
  flight_.faults = sample_.faults;
  flight_.gain = filter_.gain();
  flight_.energy_joule = filter_.passivity().energy_joule();
  flight_.heat = filter_.heat().fill();
  recorder_.record(flight_);
  flight_ = {};
}

std::optional<driver::Sample> DeviceCycle::newest(MonotonicTime now) const noexcept {
  std::optional<driver::Sample> sample = published_.read();
  const Duration age_max = (config_.bad_cycle_max + 1) * config_.period;
  if (sample && sample->lifecycle == Lifecycle::kActive &&
      now - published_at_.load(std::memory_order_relaxed) > age_max) {
    sample->faults.set(Fault::kDeviceLate);
  }
  return sample;
}

void DeviceCycle::show_observer(MonotonicTime now) noexcept {
  if (config_.observer == nullptr) return;
  const std::uint64_t holder = lease_.holder();
  if (holder != shown_holder_) {
    shown_end_ = lease_.state_of(shown_holder_);
    shown_holder_ = holder;
  }
  config_.observer->on_cycle({.time = now,
                              .sample = sample_,
                              .lease_serial = Lease::serial_of(holder),
                              .is_held = holder != Lease::kNobody,
                              .last_end = shown_end_});
}

bool DeviceCycle::needs_maintenance(MonotonicTime now) const noexcept {
  return is_to_close_ || wanted_ || jobs_.is_waiting() || has_lease_report() ||
         (lifecycle() == Lifecycle::kFault && now >= retry_at_);
}

// Reporting may take long without an exchange: the force is off before.
bool DeviceCycle::has_lease_report() const noexcept {
  return filter_.is_off() && (lease_.taken_over_count() != reported_taken_over_count_ ||
                              lease_.idle_count() != reported_idle_count_);
}

void DeviceCycle::report_lease() {
  if (!has_lease_report()) return;
  const std::uint64_t taken_over_count = lease_.taken_over_count();
  if (std::exchange(reported_taken_over_count_, taken_over_count) != taken_over_count) {
    report("a call of priority " +
           std::to_string(taken_over_at_priority_.load(std::memory_order_relaxed)) +
           " took the right to command over; the former holder's force went to zero");
  }
  const std::uint64_t idle_count = lease_.idle_count();
  if (std::exchange(reported_idle_count_, idle_count) != idle_count) {
    const auto ms = std::chrono::duration_cast<std::chrono::milliseconds>(config_.lease.idle_max);
    report("the right to command ended: its holder sent no command for " +
           std::to_string(ms.count()) + " ms; others may acquire it");
  }
}

void DeviceCycle::maintain(MonotonicTime now) {
  if (std::exchange(is_to_close_, false)) {
    driver_.deactivate();
    report("the device does not answer any more; force is off, trying to reach it again");
  }
  report_lease();
  jobs_.run();
  const std::optional<Transition> wanted = std::exchange(wanted_, std::nullopt);
  const Lifecycle before = lifecycle();
  if (wanted == Transition::kDeactivate && before != Lifecycle::kInactive) {
    driver_.deactivate();
    filter_.reset();
    sample_.wrench_applied = {};
    sample_.twist = {};
    lifecycle_.store(Lifecycle::kInactive, std::memory_order_release);
    report("the device was deactivated");
    return;
  }
  const bool is_wanted = wanted == Transition::kActivate && before != Lifecycle::kActive;
  if (!is_wanted && !(before == Lifecycle::kFault && now >= retry_at_)) return;
  retry_at_ = now + config_.retry;
  if (const auto opened = open(); opened) {
    report("the device is active again");
  } else {
    lifecycle_.store(Lifecycle::kFault, std::memory_order_release);
    // A lost device is reported once, not at every attempt.
    if (is_wanted) report(opened.error().text());
  }
}

void DeviceCycle::end(MonotonicTime now) noexcept {
  driver_.deactivate();
  lease_.revoke();
  filter_.reset();
  lifecycle_.store(Lifecycle::kFinalized, std::memory_order_release);
  sample_.wrench_applied = {};
  sample_.twist = {};
  sample_.faults = {};
  rest(now);
}

void DeviceCycle::report(std::string_view text) const {
  if (config_.listener != nullptr) config_.listener->report(text);
}

expected<void, DeviceOutcome> DeviceCycle::submit(const ClientCommand& command,
                                                  MonotonicTime received) noexcept {
  if (!lease_.renew(command.lease)) {
    foreign_command_count_.fetch_add(1, std::memory_order_relaxed);
    return unexpected{DeviceOutcome::kNotHolder};
  }
  if (emergency_.is_set()) return unexpected{DeviceOutcome::kEmergencyStop};
  if (lifecycle() != Lifecycle::kActive) return unexpected{DeviceOutcome::kNotActive};
  if (!limiter_.takes(command.setpoint.mode)) return unexpected{DeviceOutcome::kWrongMode};
  const Duration hold = std::clamp(command.hold, Duration{0}, safety().hold_max);
  const HeldCommand next{
      command.lease, command.setpoint, {wrench_of(command.setpoint), received, received + hold}};
  const MailOutcome outcome = mailbox_.put({Lease::serial_of(command.lease), command.sequence},
                                           next, [&] { return lease_.holder() == command.lease; });
  switch (outcome) {
    case MailOutcome::kPut:
      break;
    case MailOutcome::kOld:
      old_command_count_.fetch_add(1, std::memory_order_relaxed);
      return unexpected{DeviceOutcome::kSuperseded};
    case MailOutcome::kRefused:
      foreign_command_count_.fetch_add(1, std::memory_order_relaxed);
      return unexpected{DeviceOutcome::kNotHolder};
    case MailOutcome::kBusy:
      hasty_command_count_.fetch_add(1, std::memory_order_relaxed);
      return unexpected{DeviceOutcome::kTooMany};
  }
  static_cast<void>(lease_.use(command.lease));
  command_count_.fetch_add(1, std::memory_order_relaxed);
  // The filter sees it, too: zero force and a latched fault.
  if (!is_finite(command.setpoint)) return unexpected{DeviceOutcome::kNotFinite};
  return {};
}

expected<void, ModelsRefusal> DeviceCycle::set_models(const ClientModels& models) noexcept {
  if (!lease_.renew(models.lease)) return unexpected{ModelsRefusal{DeviceOutcome::kNotHolder}};
  if (emergency_.is_set()) {
    return unexpected{ModelsRefusal{DeviceOutcome::kEmergencyStop}};
  }
  if (lifecycle() != Lifecycle::kActive) {
    return unexpected{ModelsRefusal{DeviceOutcome::kNotActive}};
  }
  if (const auto checked = check(models.list, models_.limits()); !checked) {
    return unexpected{ModelsRefusal{DeviceOutcome::kOutOfRange, checked.error()}};
  }
  const bool is_after_release = release_request_.load(std::memory_order_acquire) != 0;
  const MailOutcome outcome =
      models_.put({Lease::serial_of(models.lease), models.sequence}, models, is_after_release,
                  [&] { return lease_.holder() == models.lease; });
  switch (outcome) {
    case MailOutcome::kPut:
      break;
    case MailOutcome::kOld:
      return unexpected{ModelsRefusal{DeviceOutcome::kSuperseded}};
    case MailOutcome::kRefused:
      return unexpected{ModelsRefusal{DeviceOutcome::kNotHolder}};
    case MailOutcome::kBusy:
      return unexpected{ModelsRefusal{DeviceOutcome::kTooMany}};
  }
  static_cast<void>(lease_.use(models.lease));
  return {};
}

expected<void, DeviceOutcome> DeviceCycle::request(std::uint64_t lease,
                                                   Transition transition) noexcept {
  return leave(transition_request_, lease, number_of(transition));
}

expected<void, DeviceOutcome> DeviceCycle::request(std::uint64_t lease, Release release) noexcept {
  return leave(release_request_, lease, number_of(release));
}

expected<void, DeviceOutcome> DeviceCycle::leave(std::atomic<std::uint32_t>& request,
                                                 std::uint64_t lease, std::uint16_t what) noexcept {
  std::uint32_t before = request.load(std::memory_order_acquire);
  // Checks the lease again after every concurrent request: a preempted thread of a former holder
  // must not replace the new one's.
  do {
    if (!lease_.use(lease)) return unexpected{DeviceOutcome::kNotHolder};
  } while (!request.compare_exchange_weak(before, request_of(lease, what),
                                          std::memory_order_acq_rel, std::memory_order_acquire));
  return {};
}

expected<std::uint64_t, DeviceOutcome> DeviceCycle::take_over(Priority priority) noexcept {
  if (priority < config_.operator_priority) {
    return unexpected{DeviceOutcome::kBelowOperatorPriority};
  }
  const auto id = lease_.take_over();
  if (!id) return unexpected{DeviceOutcome::kTooSoon};
  taken_over_at_priority_.store(priority.value(), std::memory_order_relaxed);
  return *id;
}

DeviceCounters DeviceCycle::counters() const noexcept {
  DeviceCounters counters = published_counters_.read().value_or(DeviceCounters{});
  counters.command_count = command_count_.load(std::memory_order_relaxed);
  counters.foreign_command_count = foreign_command_count_.load(std::memory_order_relaxed);
  counters.old_command_count = old_command_count_.load(std::memory_order_relaxed);
  counters.hasty_command_count = hasty_command_count_.load(std::memory_order_relaxed);
  return counters;
}

}  // namespace rtpm::gvd
