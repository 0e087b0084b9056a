#include "cycle.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "rtpm/driver/vector.hpp"
#include "rtpm/safety/finite.hpp"
#include "sample_check.hpp"

namespace rtpm::gvd {
namespace {

using driver::CommandMode;
using driver::ExchangeStatus;
using driver::Fault;
using driver::Lifecycle;

/// After more consecutive bad cycles than this, the device's position counts as unknown, and there
/// is no force. After more periods than this, a sample is late.
constexpr std::uint32_t kBlindCycleMax = 20;

/// How long the models' force lasts if the device's thread stops: ten cycles at 1 kHz.
constexpr Duration kModelHold = std::chrono::milliseconds{10};

/// A setpoint has only one mode: a wrench overrides efforts, and both override no command. A
/// client's motion overrides the models.
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

/// A wrench that makes the filter latch its fault.
constexpr driver::Wrench kNotFinite{{std::numeric_limits<double>::quiet_NaN(), 0, 0}, {}};

driver::Wrench wrench_of(const driver::Setpoint& setpoint) noexcept {
  if (!is_finite(setpoint)) return kNotFinite;
  return setpoint.mode == driver::CommandMode::kForce ? setpoint.wrench : driver::Wrench{};
}

struct Request {
  std::uint16_t what = 0;         ///< 0 if there is no request.
  std::uint32_t stop_number = 0;  ///< EmergencyLatch::number() at the request.
};

/// Packs a request; `what` must not be 0.
constexpr std::uint64_t request_of(std::uint64_t lease, Request request) noexcept {
  return std::uint64_t{request.stop_number} << 32 | std::uint32_t{Lease::serial_of(lease)} << 16 |
         request.what;
}

/// Takes the pending request if the holder made it; a previous holder's request is void.
Request take_request(std::atomic<std::uint64_t>& request, std::uint64_t holder) noexcept {
  if (request.load(std::memory_order_relaxed) == 0) return {};
  const std::uint64_t taken = request.exchange(0, std::memory_order_acq_rel);
  const Request left{static_cast<std::uint16_t>(taken), static_cast<std::uint32_t>(taken >> 32)};
  return holder != Lease::kNobody && taken == request_of(holder, left) ? left : Request{};
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
  const std::size_t known = std::min<std::size_t>(count_, kWindow);
  return known == 0 ? 0.0F : static_cast<float>(good_count_) / static_cast<float>(known);
}

DeviceCycle::DeviceCycle(driver::Driver& driver, CycleConfig config, SipKey lease_key)
    : driver_(driver),
      config_(config),
      lease_(config_.lease, lease_key),
      limiter_(driver.describe()),
      safety_(config_.safety ? *config_.safety : SafetyConfig::for_device(driver.describe())),
      filter_(safety_),
      models_(driver.describe(), config_.period) {
  if (config_.stop_memory != nullptr && config_.stop_memory->was_stopped()) emergency_.stop();
}

expected<void, SetupError> DeviceCycle::begin(MonotonicTime now) {
  retry_at_ = now;
  return open(now);
}

void DeviceCycle::begin_without(MonotonicTime now, const SetupError& error) {
  retry_at_ = now + config_.retry;
  lifecycle_.store(Lifecycle::kFault, std::memory_order_release);
  report(error.text() + " Trying to reach it again.");
}

expected<void, SetupError> DeviceCycle::open(MonotonicTime now) {
  if (auto configured = driver_.configure({.period = config_.period}); !configured) {
    return configured;
  }
  if (auto activated = driver_.activate(); !activated) return activated;
  filter_.reset();
  bad_cycle_count_ = 0;
  opened_at_ = now;
  published_at_.store(now, std::memory_order_relaxed);
  lifecycle_.store(Lifecycle::kActive, std::memory_order_release);
  return {};
}

const DeviceCycle::HeldCommand* DeviceCycle::command_of(MonotonicTime now,
                                                        std::uint64_t holder) noexcept {
  if (const auto newest = mailbox_.take()) {
    held_ = *newest;
    if (held_.lease == holder) {
      outputs_.follow(now, holder, held_.setpoint, held_.wrench.deadline);
    }
  }
  outputs_.take();
  // SYNC POINT not-finite
  const bool is_latching =
      not_finite_of_.load(std::memory_order_relaxed) != Lease::kNobody &&
      not_finite_of_.exchange(Lease::kNobody, std::memory_order_acq_rel) == holder;
  const Request rearm = take_request(rearm_request_, holder);
  const Request recover = take_request(recover_request_, holder);
  if (rearm.what != 0 && emergency_.is_set()) is_rearmed_ = emergency_.rearm(rearm.stop_number);
  if (recover.what != 0) filter_.recover();
  if (rearm.what != 0 || recover.what != 0) {
    // Commands from before it belong to the fault or the stop.
    drop_commands();
    models_.drop_before_release();
  } else if (is_latching) {
    held_ = {holder, {}, {kNotFinite, now, now + config_.period}};
  }
  if (emergency_.is_set()) {
    drop_commands();
    models_.drop();
    filter_.reset();
    sample_.faults.set(Fault::kEmergencyStop);
  }
  return holder == Lease::kNobody || held_.lease != holder ? nullptr : &held_;
}

const DeviceCycle::HeldCommand* DeviceCycle::with_models(MonotonicTime now, std::uint64_t holder,
                                                         const HeldCommand* newest) noexcept {
  models_.take_for(holder);
  // A number that is not finite latches the filter's fault, regardless of the models.
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

void DeviceCycle::drop_commands() noexcept {
  held_ = {};
  outputs_.drop();
}

driver::Command DeviceCycle::filter(MonotonicTime now, const HeldCommand* newest,
                                    bool has_outputs) noexcept {
  driver::Command command;
  const driver::Wrench wrench =
      filter_.step(now, newest != nullptr ? std::optional(newest->wrench) : std::nullopt,
                   {sample_.pose.position_m, sample_.twist, sample_.wrench_applied});
  if (filter_.is_following()) {
    static_cast<driver::Setpoint&>(command) = limiter_.limit(newest->setpoint);
    efforts_ = {};
    if (command.mode == CommandMode::kJointEffort) efforts_ = command.joints;
  }
  // When commands stop, efforts fall like a wrench; motion and outputs stop at once.
  if (efforts_ != decltype(efforts_){} && filter_.gain() > 0) {
    command.mode = CommandMode::kJointEffort;
    for (std::size_t i = 0; i < efforts_.size(); ++i)
      command.joints[i] = efforts_[i] * filter_.gain();
  } else {
    efforts_ = {};
  }
  command.wrench = wrench;
  if (wrench != driver::Wrench{}) command.mode = CommandMode::kForce;
  command.outputs = limiter_.safe_outputs();
  command.deadline = filter_.zero_at();
  if (has_outputs && !filter_.is_latched()) {
    command.outputs = limiter_.limit(driver::Setpoint::with_outputs(outputs_.values())).outputs;
    if (command.mode == CommandMode::kOff) {
      command.mode = CommandMode::kOutputs;
      command.deadline = outputs_.deadline();
    }
  }
  command.sequence = counters_.cycle_count;
  command.cycle_time = now;
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
  const HeldCommand* newest = with_models(now, holder, command_of(now, holder));
  if (bad_cycle_count_ > kBlindCycleMax) newest = nullptr;
  if (const Request left = take_request(transition_request_, holder); left.what != 0) {
    wanted_ = static_cast<Transition>(left.what - 1);
  }
  if (lifecycle() != Lifecycle::kActive) {
    rest(now);
    return;
  }

  const driver::Faults stop_faults = sample_.faults;
  const bool has_outputs = outputs_.is_live(now, holder);
  const BadCycle bad = exchange(now, filter(now, newest, has_outputs));
  sample_.faults.set(stop_faults);
  if (bad == BadCycle::kGone || is_bad_for_too_long(now)) {
    lose(bad);
    retry_at_ = now + config_.retry;
  }
  sample_.faults.set(filter_.faults());
  const bool has_command = has_outputs || (newest != nullptr && now < newest->wrench.deadline);
  for (std::uint32_t i = 0; i < std::min(missed_count, SuccessRate::kWindow); ++i)
    success_.record(false);
  success_.record(bad == BadCycle::kNone && (holder == Lease::kNobody || has_command));
  publish(now);
}

DeviceCycle::BadCycle DeviceCycle::exchange(MonotonicTime now,
                                            const driver::Command& command) noexcept {
  // The driver writes to a copy, so that a failed exchange changes nothing.
  driver::Sample taken = sample_;
  const ExchangeStatus status = driver_.exchange(command, taken);
  if (status == ExchangeStatus::kGone) return BadCycle::kGone;
  if (status == ExchangeStatus::kLate) {
    sample_.faults.set(Fault::kDeviceLate);
    ++counters_.late_count;
    return count_bad(now, BadCycle::kLate);
  }
  const std::string_view field = not_finite_field(taken);
  if (status == ExchangeStatus::kOk && field.empty()) {
    sample_ = taken;
    sample_.faults = taken.faults.only(driver::kDriverFaults);
    if (!is_plausible(taken, {opened_at_, now, config_.period})) {
      sample_.faults.set(Fault::kImplausible);
    }
    bad_cycle_count_ = 0;
    return BadCycle::kNone;
  }
  sample_.faults.set(Fault::kDeviceCorrupt);
  ++counters_.corrupt_count;
  if (status == ExchangeStatus::kOk) {
    not_finite_field_ = field;
    return count_bad(now, BadCycle::kNotFinite);
  }
  return count_bad(
      now, status == ExchangeStatus::kCorrupt ? BadCycle::kCorrupt : BadCycle::kUnknownStatus);
}

DeviceCycle::BadCycle DeviceCycle::count_bad(MonotonicTime now, BadCycle bad) noexcept {
  if (bad_cycle_count_++ == 0) bad_since_ = now;
  return bad;
}

bool DeviceCycle::is_bad_for_too_long(MonotonicTime now) const noexcept {
  return bad_cycle_count_ > kBlindCycleMax && now - bad_since_ >= config_.gone_after;
}

void DeviceCycle::lose(BadCycle why) noexcept {
  lost_by_ = why;
  ++counters_.gone_count;
  is_to_close_ = true;
  filter_.reset();
  // The holder must acquire the lease again once the device is back.
  lease_.revoke();
  lifecycle_.store(Lifecycle::kFault, std::memory_order_release);
  sample_.faults.set(Fault::kDeviceGone);
  sample_.wrench_applied = {};
  sample_.twist = {};
}

void DeviceCycle::rest(MonotonicTime now) noexcept {
  // Keeps the filter running, so that latched faults show and soft start begins at zero.
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
  const Duration age = now - published_at_.load(std::memory_order_relaxed);
  if (sample && sample->lifecycle == Lifecycle::kActive &&
      age > (kBlindCycleMax + 1) * config_.period) {
    sample->faults.set(Fault::kDeviceLate);
    const auto missed_count = std::min<std::int64_t>(age / config_.period, SuccessRate::kWindow);
    sample->success_rate *= 1 - static_cast<float>(missed_count) / SuccessRate::kWindow;
  }
  return sample;
}

Duration DeviceCycle::silence(MonotonicTime now) const noexcept {
  if (lifecycle() != Lifecycle::kActive) return Duration{0};
  return now - published_at_.load(std::memory_order_relaxed);
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
  if (std::exchange(shown_models_, models_.revision()) != models_.revision()) {
    config_.observer->on_models({now, sample_.sequence, models_.list()});
  }
}

bool DeviceCycle::needs_maintenance(MonotonicTime now) const noexcept {
  return is_to_close_ || is_rearmed_ || wanted_ || jobs_.is_waiting() || has_lease_report() ||
         (lifecycle() == Lifecycle::kFault && now >= retry_at_);
}

// A report may take long without an exchange, so the force must be off first.
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
    report(loss_text() + "; force is off, trying to reach it again");
  }
  report_lease();
  if (std::exchange(is_rearmed_, false) && config_.stop_memory != nullptr) {
    config_.stop_memory->on_change();
  }
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
  if (const auto opened = open(now); opened) {
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

std::string DeviceCycle::loss_text() const {
  const auto ms = std::chrono::duration_cast<std::chrono::milliseconds>(config_.gone_after).count();
  const std::string long_enough = " for " + std::to_string(ms) + " ms";
  switch (lost_by_) {
    case BadCycle::kNone:
    case BadCycle::kGone:
      break;
    case BadCycle::kLate:
      return "the device has sent nothing new" + long_enough;
    case BadCycle::kCorrupt:
      return "the device has sent only unreadable data" + long_enough;
    case BadCycle::kNotFinite:
      return "the driver has given only samples with a NaN or infinity, last in " +
             std::string(not_finite_field_) + "," + long_enough;
    case BadCycle::kUnknownStatus:
      return "the driver's exchange() has returned statuses that do not exist" + long_enough;
  }
  return "the device does not answer any more";
}

void DeviceCycle::emergency_stop() noexcept {
  emergency_.stop();
  if (config_.stop_memory != nullptr) config_.stop_memory->on_change();
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
  const MailStamp stamp{Lease::serial_of(command.lease), command.sequence};
  const auto is_allowed = [&] { return lease_.holder() == command.lease; };
  // A setpoint with a NaN or an infinity goes to the filter, regardless of its mode.
  const bool has_outputs_only =
      command.setpoint.mode == CommandMode::kOutputs && is_finite(command.setpoint);
  const MailOutcome outcome =
      has_outputs_only
          ? outputs_.put(stamp, {command.lease, command.setpoint.outputs, received + hold},
                         is_allowed)
          : mailbox_.put(stamp, next, is_allowed);
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
  if (is_finite(command.setpoint)) return {};
  // SYNC POINT not-finite: the next cycle lets the filter see it: zero force and a latched fault.
  not_finite_of_.store(command.lease, std::memory_order_release);
  return unexpected{DeviceOutcome::kNotFinite};
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
  const bool is_after_release = rearm_request_.load(std::memory_order_acquire) != 0 ||
                                recover_request_.load(std::memory_order_acquire) != 0;
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
  return leave(release == Release::kRearm ? rearm_request_ : recover_request_, lease,
               number_of(release));
}

expected<void, DeviceOutcome> DeviceCycle::leave(std::atomic<std::uint64_t>& request,
                                                 std::uint64_t lease, std::uint16_t what) noexcept {
  const Request left{what, emergency_.number()};
  std::uint64_t before = request.load(std::memory_order_acquire);
  // Checks the lease again after every concurrent request: a preempted thread of a previous holder
  // must not replace the new holder's request.
  do {
    if (!lease_.use(lease)) return unexpected{DeviceOutcome::kNotHolder};
  } while (!request.compare_exchange_weak(before, request_of(lease, left),
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
