#include "cycle.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "finite.hpp"

namespace rtpm::gvd {
namespace {

using driver::ExchangeStatus;
using driver::Fault;
using driver::Lifecycle;

/// Whether every number is finite.
bool is_whole(const driver::Sample& sample) noexcept {
  const driver::Quaternion& turn = sample.pose.orientation;
  return is_finite(sample.pose.position_m) && is_finite(sample.twist.linear_m_per_s) &&
         is_finite(sample.twist.angular_rad_per_s) && is_finite(sample.wrench_applied) &&
         std::isfinite(turn.x) && std::isfinite(turn.y) && std::isfinite(turn.z) &&
         std::isfinite(turn.w) &&
         std::all_of(sample.analogs.begin(), sample.analogs.end(),
                     [](float value) { return std::isfinite(value); });
}

constexpr std::uint16_t kRecovery = 1;

constexpr std::uint16_t number_of(Transition transition) noexcept {
  return static_cast<std::uint16_t>(static_cast<int>(transition) + 1);
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
      filter_(config_.safety ? *config_.safety
                             : SafetyConfig::for_device(driver.describe().limits)) {}

expected<void, SetupError> DeviceCycle::begin(MonotonicTime now) {
  retry_at_ = now;
  return open();
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

std::optional<WrenchCommand> DeviceCycle::command_of(std::uint64_t holder) noexcept {
  if (const auto newest = mailbox_.take()) held_ = *newest;
  if (take_request(recovery_request_, holder) != 0) {
    filter_.recover();
    // Commands before the recovery belong to the fault.
    held_ = {};
  }
  if (holder == Lease::kNobody || held_.lease != holder) return std::nullopt;
  return held_.command;
}

void DeviceCycle::run(MonotonicTime now, std::uint32_t missed_count) noexcept {
  ++counters_.cycle_count;
  counters_.missed_count += missed_count;
  const std::uint64_t holder = lease_.step(now);
  if (std::exchange(last_holder_, holder) != holder) filter_.change_client();
  const std::optional<WrenchCommand> newest = command_of(holder);
  if (const auto what = take_request(transition_request_, holder); what != 0) {
    wanted_ = static_cast<Transition>(what - 1);
  }
  sample_.faults = {};
  if (lifecycle() != Lifecycle::kActive) {
    rest(now);
    return;
  }

  driver::Command command;
  command.sequence = counters_.cycle_count;
  command.cycle_time = now;
  command.wrench = filter_.step(now, newest);
  command.mode =
      command.wrench == driver::Wrench{} ? driver::CommandMode::kOff : driver::CommandMode::kForce;
  command.deadline = filter_.zero_at();
  const ExchangeStatus status = exchange(command);
  if (status == ExchangeStatus::kGone || bad_cycle_count_ > config_.bad_cycle_max) {
    lose();
    retry_at_ = now + config_.retry;
  }
  sample_.faults.set(filter_.faults());
  const bool has_command = newest && now < newest->deadline;
  success_.record(status == ExchangeStatus::kOk && missed_count == 0 &&
                  (holder == Lease::kNobody || has_command));
  publish();
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
  sample_.faults.set(filter_.faults());
  if (lifecycle() == Lifecycle::kFault) {
    sample_.faults.set(Fault::kDeviceGone);
    success_.record(false);
  }
  publish();
}

void DeviceCycle::publish() noexcept {
  sample_.sequence = counters_.cycle_count;
  sample_.success_rate = success_.share();
  sample_.lifecycle = lifecycle();
  published_.write(sample_);
  counters_.safety = filter_.counters();
  counters_.lease_expired_count = lease_.expired_count();
  counters_.lease_idle_count = lease_.idle_count();
  counters_.lease_taken_over_count = lease_.taken_over_count();
  published_counters_.write(counters_);
}

bool DeviceCycle::needs_maintenance(MonotonicTime now) const noexcept {
  return is_to_close_ || wanted_ || has_lease_report() ||
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

rpc::Result<void> DeviceCycle::submit(const ForceCommand& command,
                                      MonotonicTime received) noexcept {
  if (!lease_.renew(command.lease)) {
    foreign_command_count_.fetch_add(1, std::memory_order_relaxed);
    return unexpected{rpc::Refusal::kNotLeaseHolder};
  }
  if (lifecycle() != Lifecycle::kActive) return unexpected{rpc::Refusal::kGone};
  const Duration hold = std::clamp(command.hold, Duration{0}, safety().hold_max);
  const HeldCommand next{
      command.lease, command.sequence, {command.wrench, received, received + hold}};
  const MailOutcome outcome = mailbox_.put({Lease::serial_of(command.lease), command.sequence},
                                           next, [&] { return lease_.holder() == command.lease; });
  switch (outcome) {
    case MailOutcome::kPut:
      break;
    case MailOutcome::kOld:
      old_command_count_.fetch_add(1, std::memory_order_relaxed);
      return unexpected{rpc::Refusal::kBadRequest};
    case MailOutcome::kRefused:
      foreign_command_count_.fetch_add(1, std::memory_order_relaxed);
      return unexpected{rpc::Refusal::kNotLeaseHolder};
    case MailOutcome::kBusy:
      hasty_command_count_.fetch_add(1, std::memory_order_relaxed);
      return unexpected{rpc::Refusal::kOverload};
  }
  static_cast<void>(lease_.use(command.lease));
  command_count_.fetch_add(1, std::memory_order_relaxed);
  // The filter sees it, too: zero force and a latched fault.
  if (!is_finite(command.wrench)) return unexpected{rpc::Refusal::kBadRequest};
  return {};
}

rpc::Result<void> DeviceCycle::request(std::uint64_t lease, Transition transition) noexcept {
  return leave(transition_request_, lease, number_of(transition));
}

rpc::Result<void> DeviceCycle::request_recovery(std::uint64_t lease) noexcept {
  return leave(recovery_request_, lease, kRecovery);
}

rpc::Result<void> DeviceCycle::leave(std::atomic<std::uint32_t>& request, std::uint64_t lease,
                                     std::uint16_t what) noexcept {
  std::uint32_t before = request.load(std::memory_order_acquire);
  // Checks the lease again after every concurrent request: a preempted thread of a former holder
  // must not replace the new one's.
  do {
    if (!lease_.use(lease)) return unexpected{rpc::Refusal::kNotLeaseHolder};
  } while (!request.compare_exchange_weak(before, request_of(lease, what),
                                          std::memory_order_acq_rel, std::memory_order_acquire));
  return {};
}

rpc::Result<std::uint64_t> DeviceCycle::take_over(Priority priority) noexcept {
  if (priority < config_.operator_priority) return unexpected{rpc::Refusal::kNotLeaseHolder};
  const auto id = lease_.take_over();
  if (!id) return unexpected{rpc::Refusal::kOverload};
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
