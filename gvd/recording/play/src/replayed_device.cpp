#include "replayed_device.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "rtpm/driver/sample.hpp"
#include "rtpm/gvd/wire.hpp"
#include "rtpm/rt/clock.hpp"

namespace rtpm::replay {
namespace {

using driver::ExchangeStatus;

/// A driver that is active while the recorded device was, returns its samples, and ignores
/// commands.
class ReplayDriver final : public driver::Driver {
 public:
  ReplayDriver(const ReplayedDevice& device, driver::Descriptor descriptor)
      : device_(device), descriptor_(std::move(descriptor)) {}

  driver::Descriptor describe() const override { return descriptor_; }
  expected<void, SetupError> configure(const driver::DriverConfig&) override {
    if (device_.active(rt::now()) != nullptr) return {};
    return setup_error(device_.name() + " was not active at this time");
  }
  expected<void, SetupError> activate() override { return {}; }
  ExchangeStatus exchange(const driver::Command& command,
                          driver::Sample& sample) noexcept override {
    const device::Sample* const active = device_.active(command.cycle_time);
    if (active == nullptr) return ExchangeStatus::kGone;
    sample = gvd::from_wire(*active);
    return ExchangeStatus::kOk;
  }
  void deactivate() noexcept override {}

 private:
  const ReplayedDevice& device_;
  driver::Descriptor descriptor_;
};

/// The settings of the recorded device's server.
gvd::CycleConfig cycle_of(const device::Description& description,
                          const driver::Descriptor& descriptor) {
  using std::chrono::microseconds;
  gvd::CycleConfig cycle;
  const double period_ns = std::round(1e9 / description.rate_hz());
  cycle.period = Duration{period_ns > 0 && period_ns < 1e18 ? std::llround(period_ns) : 0};
  cycle.operator_priority = static_cast<int>(
      std::min<std::uint32_t>(description.operator_priority(), Priority::kHighest));
  // The recorded device becomes active again in the right cycle.
  cycle.retry = std::chrono::milliseconds{1};
  cycle.safety = gvd::SafetyConfig::for_device(descriptor);
  cycle.safety->hold_max = microseconds{description.hold_us_max()};
  cycle.safety->ramp = microseconds{description.ramp_us()};
  return cycle;
}

/// Like a device server's sample of an unplugged device.
device::Sample gone(const device::Sample& last) noexcept {
  driver::Sample sample = gvd::from_wire(last);
  sample.lifecycle = driver::Lifecycle::kFault;
  sample.faults.set(driver::Fault::kDeviceGone);
  return gvd::to_wire(sample);
}

}  // namespace

ReplayedDevice::ReplayedDevice(const RecordedDevice& recorded, Pace& pace, End end,
                               std::unique_ptr<capture::CommandRecorder> commands)
    : recorded_(recorded), pace_(pace), end_(end), commands_(std::move(commands)) {}

expected<void, SetupError> ReplayedDevice::start(gvd::EmergencyStops& stops) {
  const auto& description =
      *flatbuffers::GetRoot<device::Description>(recorded_.description.data());
  driver::Descriptor descriptor = gvd::from_wire(description);
  gvd::DeviceServerConfig config{
      .cycle = cycle_of(description, descriptor),
      .starts_without_device = true,
      .thread = {.name = "rtpm-replay", .realtime = rt::RealtimeMode::kOff},
      .view = this};
  config.cycle.emergency_stops = &stops;
  auto server = gvd::DeviceServer::create(
      std::make_unique<ReplayDriver>(*this, std::move(descriptor)), std::move(config));
  if (!server) return unexpected{std::move(server.error())};
  server_ = std::move(*server);
  return server_->start();
}

ReplayedDevice::Counters ReplayedDevice::counters() const noexcept {
  return {read_count_.load(std::memory_order_relaxed),
          command_count_.load(std::memory_order_relaxed),
          refused_count_.load(std::memory_order_relaxed)};
}

bool ReplayedDevice::is_gone(MonotonicTime now) const noexcept {
  if (end_ != End::kGone) return false;
  return pace_.is_stepped() ? is_gone_.load(std::memory_order_acquire) : pace_.is_over(now);
}

const device::Sample* ReplayedDevice::active(MonotonicTime now) const noexcept {
  const device::Sample* const sample = is_gone(now) ? nullptr : shown(now);
  constexpr auto kActive = static_cast<std::uint8_t>(driver::Lifecycle::kActive);
  return sample != nullptr && sample->lifecycle() == kActive ? sample : nullptr;
}

const device::Sample* ReplayedDevice::shown(MonotonicTime now) const noexcept {
  const std::uint64_t count = recorded_.samples.size();
  if (!pace_.is_stepped()) {
    const auto after = std::ranges::upper_bound(recorded_.times, pace_.position(now).at);
    const auto before = static_cast<std::size_t>(after - recorded_.times.begin());
    return before == 0 ? nullptr : &recorded_.samples[before - 1];
  }
  // Before the first step the device shows its first sample.
  const std::uint64_t step = std::max<std::uint64_t>(step_count_.load(), 1) - 1;
  return &recorded_.samples[end_ == End::kLoop ? step % count : std::min(step, count - 1)];
}

const device::Sample* ReplayedDevice::next_sample(MonotonicTime now) noexcept {
  const std::uint64_t count = recorded_.samples.size();
  const std::uint64_t step = step_count_.fetch_add(1, std::memory_order_acq_rel);
  if (step >= count && end_ != End::kLoop) {
    is_gone_.store(end_ == End::kGone, std::memory_order_release);
    return &recorded_.samples.back();
  }
  pace_.step_to({recorded_.times[step % count], step / count});
  if (step + 1 == count && end_ != End::kLoop) pace_.end_steps(now);
  return &recorded_.samples[step % count];
}

device::Sample ReplayedDevice::on_read(MonotonicTime now) noexcept {
  read_count_.fetch_add(1, std::memory_order_relaxed);
  const device::Sample* const sample = pace_.is_stepped() ? next_sample(now) : shown(now);
  if (sample == nullptr) return {};
  return is_gone(now) ? gone(*sample) : *sample;
}

void ReplayedDevice::on_command(const device::Command& command, gvd::DeviceOutcome outcome,
                                MonotonicTime now) noexcept {
  const bool is_accepted = outcome == gvd::DeviceOutcome::kDone;
  (is_accepted ? command_count_ : refused_count_).fetch_add(1, std::memory_order_relaxed);
  if (!is_accepted || commands_ == nullptr) return;
  if (const device::Sample* const sample = shown(now))
    commands_->record(command, sample->sequence());
}

}  // namespace rtpm::replay
