#include "rtpm/gvd/server.hpp"

#include <atomic>
#include <cmath>
#include <future>
#include <memory>
#include <string>
#include <utility>

#include "configurable_device.hpp"
#include "holder_servant.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/memory.hpp"
#include "rtpm/rt/semaphore.hpp"
#include "rtpm/safety/finite.hpp"
#include "rtpm/safety/parameters.hpp"
#include "servant.hpp"

namespace rtpm::gvd {
namespace {

constexpr Duration kPeriodMin = std::chrono::microseconds{20};
constexpr Duration kPeriodMax = std::chrono::milliseconds{100};
/// How long start() waits for a driver to set its device up, if starts_without_device.
constexpr std::chrono::seconds kStartPatience{2};

expected<void, SetupError> check(const LeaseConfig& lease) {
  constexpr Duration kNone{0};
  if (lease.silence_max > kNone && lease.idle_max > kNone && lease.acquire_interval >= kNone &&
      lease.take_over_interval >= kNone && lease.operator_silence_max > kNone) {
    return {};
  }
  return setup_error(
      "the device's lease has silence_max, idle_max or operator_silence_max that is not above "
      "zero, "
      "or an interval below it",
      "a lease that is over at once commands nothing");
}

bool is_limit(double value) noexcept {
  return std::isfinite(value) && value >= 0;
}

bool is_whole(const driver::Limits& limits) noexcept {
  return is_limit(limits.force_newton_max) && is_limit(limits.torque_newton_metre_max) &&
         is_limit(limits.stiffness_newton_per_m_max) && is_limit(limits.damping_newton_s_per_m) &&
         is_limit(limits.velocity_m_per_s_max) && is_limit(limits.velocity_rad_per_s_max);
}

/// False for NaN, too.
bool is_box(const driver::Workspace& workspace) noexcept {
  const driver::Vector3& low = workspace.low_m;
  const driver::Vector3& high = workspace.high_m;
  return is_finite(low) && is_finite(high) && low.x <= high.x && low.y <= high.y && low.z <= high.z;
}

expected<void, SetupError> check(const driver::Descriptor& descriptor) {
  const std::string device = "the driver of \"" + descriptor.model + "\"";
  if (descriptor.model.empty() || descriptor.serial.empty() || descriptor.frame.empty()) {
    return setup_error(device + " leaves model, serial or frame empty", "", "name all three");
  }
  if (descriptor.buttons.size() > driver::kButtonCountMax ||
      descriptor.analogs.size() > driver::kAnalogCountMax ||
      descriptor.joints.size() > driver::kJointCountMax ||
      descriptor.outputs.size() > driver::kOutputCountMax) {
    return setup_error(device + " has more buttons, analogs, joints or outputs than a sample holds",
                       "", "serve the rest as a second device");
  }
  for (const driver::Joint& joint : descriptor.joints) {
    if (joint.low <= joint.high && joint.velocity_max >= 0 && joint.effort_max >= 0) continue;
    return setup_error(device + " has a joint \"" + joint.name + "\" with limits in disorder");
  }
  for (const driver::Output& output : descriptor.outputs) {
    if (output.low <= output.safe && output.safe <= output.high) continue;
    return setup_error(device + " has an output \"" + output.name +
                       "\" whose safe value is outside its range");
  }
  for (const driver::CommandMode mode : descriptor.modes) {
    if (static_cast<std::uint8_t>(mode) < driver::kCommandModeCount) continue;
    return setup_error(device + " lists a mode that does not exist");
  }
  for (const driver::Analog& analog : descriptor.analogs) {
    if (std::isfinite(analog.low) && std::isfinite(analog.high) && analog.low <= analog.high) {
      continue;
    }
    return setup_error(device + " has an analog \"" + analog.name + "\" with a range in disorder");
  }
  if (!is_whole(descriptor.limits)) {
    return setup_error(device + " has a limit that is negative or no finite number", "",
                       "state what the maker guarantees, and 0 for actuators that are not there");
  }
  if (!is_box(descriptor.workspace)) {
    return setup_error(device +
                       " has a workspace that is not finite, or whose low corner is above its "
                       "high one");
  }
  return {};
}

expected<void, SetupError> check(const std::vector<driver::ParameterSpec>& parameters,
                                 const std::string& model) {
  for (const driver::ParameterSpec& spec : parameters) {
    if (!spec.name.starts_with(kSafetyGroup)) continue;
    return setup_error("the driver of \"" + model + "\" has a parameter \"" + spec.name + "\"",
                       "the group \"" + std::string(kSafetyGroup) + "\" is the device server's own",
                       "name it otherwise");
  }
  return {};
}

}  // namespace

// Members are ordered by construction, not by padding.
// NOLINTNEXTLINE(clang-analyzer-optin.performance.Padding)
struct DeviceServer::Impl {
  Impl(std::unique_ptr<driver::Driver> served, driver::Descriptor described,
       DeviceServerConfig given)
      : driver(std::move(served)),
        descriptor(std::move(described)),
        config(std::move(given)),
        cycle(*driver, config.cycle, random_lease_key()),
        servant(cycle, descriptor, config.cycle.period, config.view),
        holder_servant(cycle.lease()),
        configurable(*driver, descriptor, cycle) {}

  expected<void, SetupError> start() {
    RTPM_ASSERT(!device_thread.is_running(), "a device server starts once");
    is_stopping.store(false, std::memory_order_relaxed);
    cycle.jobs().begin();
    auto started = start_thread();
    if (!started) cycle.jobs().end();
    return started;
  }

  expected<void, SetupError> start_thread() {
    // Shared, because the driver may return after start() has stopped waiting.
    const auto begun = std::make_shared<std::promise<expected<void, SetupError>>>();
    auto outcome = begun->get_future();
    auto thread = rt::Thread::start(config.thread, [this, begun] {
      auto began = cycle.begin(rt::now());
      if (!began && config.starts_without_device) {
        cycle.begin_without(rt::now(), began.error());
        began = {};
      }
      const bool is_active = began.has_value();
      // The first sample exists before the first caller.
      if (is_active) cycle.run(rt::now(), 0);
      begun->set_value(std::move(began));
      if (!is_active) return;
      loop();
      has_ended.post();
    });
    if (!thread) return unexpected{std::move(thread.error())};
    if (config.starts_without_device &&
        outcome.wait_for(kStartPatience) == std::future_status::timeout) {
      device_thread = std::move(*thread);
      return {};
    }
    auto began = outcome.get();
    if (!began) {
      thread->join();
      return unexpected{std::move(began.error())};
    }
    device_thread = std::move(*thread);
    return {};
  }

  void request_stop() noexcept { is_stopping.store(true, std::memory_order_relaxed); }

  /// False if the driver has not returned by `deadline`: then its thread continues.
  bool stop(MonotonicTime deadline) noexcept {
    if (!device_thread.is_running()) return true;
    request_stop();
    if (!has_ended.wait_until(deadline)) return false;
    device_thread.join();
    cycle.jobs().end();
    return true;
  }

  /// The device's thread: one cycle per period at absolute times, so that a late wake-up does not
  /// shift the next.
  void loop() noexcept {
    const rt::NoAllocationScope no_allocation;
    const Duration period = config.cycle.period;
    MonotonicTime due = rt::now();
    std::uint32_t missed_count = 0;
    while (!is_stopping.load(std::memory_order_relaxed)) {
      rt::sleep_until(due);
      const MonotonicTime begin = rt::now();
      cycle.run(begin, std::exchange(missed_count, 0));
      if (cycle.needs_maintenance(begin)) {
        const rt::AllowAllocationScope set_up;
        cycle.maintain(begin);
        due = rt::now();
      }
      due += period;
      // Missed cycles are skipped and counted, never made up in a burst.
      if (const Duration behind = rt::now() - due; behind >= period) {
        const auto left_out = behind / period;
        due += left_out * period;
        missed_count = static_cast<std::uint32_t>(left_out);
      }
    }
    const rt::AllowAllocationScope set_down;
    cycle.end(rt::now());
  }

  std::unique_ptr<driver::Driver> driver;
  driver::Descriptor descriptor;
  DeviceServerConfig config;
  DeviceCycle cycle;
  DeviceServant servant;
  HolderServant holder_servant;
  ConfigurableDevice configurable;
  std::atomic<bool> is_stopping{false};
  rt::Semaphore has_ended{};  ///< Posted by the device's thread.
  rt::Thread device_thread{};
};

expected<std::unique_ptr<DeviceServer>, SetupError> DeviceServer::create(
    std::unique_ptr<driver::Driver> driver, DeviceServerConfig config) {
  RTPM_ASSERT(driver != nullptr, "a device server needs a driver");
  const Duration period = config.cycle.period;
  if (period < kPeriodMin || period > kPeriodMax) {
    return setup_error("the device's period is " + std::to_string(period.count()) + " ns", "",
                       "choose 20 µs to 100 ms (10 to 50000 Hz)");
  }
  if (auto checked = check(config.cycle.lease); !checked) return unexpected{checked.error()};
  driver::Descriptor descriptor = driver->describe();
  if (auto checked = check(descriptor); !checked) return unexpected{checked.error()};
  if (auto checked = check(driver->parameters(), descriptor.model); !checked) {
    return unexpected{checked.error()};
  }
  const SafetyConfig safety = config.cycle.safety.value_or(SafetyConfig::for_device(descriptor));
  if (auto checked = safety.check(); !checked) return unexpected{checked.error()};
  return std::unique_ptr<DeviceServer>(new DeviceServer(
      std::make_unique<Impl>(std::move(driver), std::move(descriptor), std::move(config))));
}

DeviceServer::DeviceServer(std::unique_ptr<Impl> impl) noexcept : impl_(std::move(impl)) {}
DeviceServer::~DeviceServer() {
  impl_->stop(kNever);
}
expected<void, SetupError> DeviceServer::start() {
  return impl_->start();
}
void DeviceServer::request_stop() noexcept {
  impl_->request_stop();
}
bool DeviceServer::stop(Duration patience) noexcept {
  return impl_->stop(rt::now() + patience);
}
void DeviceServer::emergency_stop() noexcept {
  impl_->cycle.emergency_stop();
}
bool DeviceServer::is_stopped() const noexcept {
  return impl_->cycle.is_stopped();
}
const FlightRecorder& DeviceServer::flight_recorder() const noexcept {
  return impl_->cycle.flight_recorder();
}
rpc::Servant& DeviceServer::servant() noexcept {
  return impl_->servant;
}
rpc::Servant& DeviceServer::holder_servant() noexcept {
  return impl_->holder_servant;
}
Configurable& DeviceServer::configurable() noexcept {
  return impl_->configurable;
}
const driver::Descriptor& DeviceServer::descriptor() const noexcept {
  return impl_->descriptor;
}
std::optional<driver::Sample> DeviceServer::newest() const noexcept {
  return impl_->cycle.newest();
}
Duration DeviceServer::silence() const noexcept {
  return impl_->cycle.silence(rt::now());
}
DeviceCounters DeviceServer::counters() const noexcept {
  return impl_->cycle.counters();
}

}  // namespace rtpm::gvd
