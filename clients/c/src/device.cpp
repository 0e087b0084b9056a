#include <algorithm>
#include <memory>
#include <mutex>
#include <string>
#include <utility>

#include "guard.hpp"
#include "node.hpp"
#include "rtpm/gvd/client.hpp"
#include "rtpm/rt/clock.hpp"

using namespace rtpm;

/// A device, with what a program says once.
struct rtpm_device {
  std::string name;
  gvd::DeviceClient client;
  rpc::CallOptions options;
  std::mutex mutex{};  ///< Reads and commands do without: the client allows them at a time.
};

namespace {

/// How long take_over() waits for a device that grants one a second.
constexpr Duration kTakeOverPatience = std::chrono::milliseconds{1500};
constexpr Duration kTakeOverInterval = std::chrono::milliseconds{50};
/// To activate, a driver may have to find and open its device.
constexpr Duration kEffectPatience = std::chrono::seconds{5};
constexpr Duration kEffectInterval = std::chrono::milliseconds{2};

rtpm_status status_of(const rtpm_device& device, const char* what,
                      const gvd::DeviceResult& result) noexcept {
  return result ? RTPM_OK : c::failed(device.name + ": " + what, result.error());
}

/// Waits until a sample shows the effect of a request, which takes place in the next cycle. The
/// cycle of the first sample may have begun before the request, that of the second behind it not.
template <class Effect>
rtpm_status await(rtpm_device& device, const char* what, const Effect& effect) noexcept {
  const MonotonicTime end = rt::now() + kEffectPatience;
  std::uint64_t shows = 0;
  while (true) {
    const auto sample = device.client.read(device.options);
    if (sample && shows == 0) shows = sample->sequence + 2;
    if (sample && sample->sequence >= shows && effect(*sample)) return RTPM_OK;
    if (rt::now() >= end) {
      return c::failed(RTPM_FAILED, device.name + ": " + what +
                                        ": the device took it, but does not show it within 5 s");
    }
    rt::sleep_until(rt::now() + kEffectInterval);
  }
}

/// Runs a request to the device that takes its time.
template <class Request>
rtpm_status request(rtpm_device* device, const char* what, const Request& run) noexcept {
  return c::guarded([&] {
    if (device == nullptr) return c::invalid(std::string(what) + ": device is NULL");
    const std::lock_guard lock(device->mutex);
    return status_of(*device, what, run(device->client));
  });
}

/// The same, until the effect shows.
template <class Request, class Effect>
rtpm_status request(rtpm_device* device, const char* what, const Request& run,
                    const Effect& effect) noexcept {
  const rtpm_status status = request(device, what, run);
  return status == RTPM_OK ? c::guarded([&] { return await(*device, what, effect); }) : status;
}

rtpm_status set(rtpm_device& device, const driver::Setpoint& setpoint) noexcept {
  return status_of(device, "a command", device.client.set(setpoint, device.options));
}

void copy(const driver::Vector3& from, double (&to)[3]) noexcept {
  to[0] = from.x;
  to[1] = from.y;
  to[2] = from.z;
}
template <class T, std::size_t N>
void copy(const std::array<T, N>& from, T (&to)[N]) noexcept {
  std::ranges::copy(from, to);
}
template <std::size_t N>
void copy(const std::string& from, char (&to)[N]) noexcept {
  to[from.copy(to, N - 1)] = '\0';
}

rtpm_sample in_c(const driver::Sample& sample) noexcept {
  rtpm_sample out{};
  out.buttons = sample.buttons;
  out.sequence = sample.sequence;
  out.host_time_ns = sample.host_time.time_since_epoch().count();
  copy(sample.pose.position_m, out.position_m);
  const driver::Quaternion& q = sample.pose.orientation;
  const double orientation[4] = {q.x, q.y, q.z, q.w};
  std::ranges::copy(orientation, out.orientation);
  copy(sample.twist.linear_m_per_s, out.linear_m_per_s);
  copy(sample.twist.angular_rad_per_s, out.angular_rad_per_s);
  copy(sample.wrench_applied.force_newton, out.force_newton);
  copy(sample.wrench_applied.torque_newton_metre, out.torque_newton_metre);
  copy(sample.joints, out.joints);
  copy(sample.joint_velocities, out.joint_velocities);
  copy(sample.efforts_applied, out.efforts);
  copy(sample.outputs_applied, out.outputs);
  copy(sample.analogs, out.analogs);
  copy(sample.button_edges, out.button_edges);
  out.faults = sample.faults.bits();
  out.lifecycle = static_cast<std::uint32_t>(sample.lifecycle);
  return out;
}

rtpm_description in_c(const driver::Descriptor& descriptor, Duration force_end) noexcept {
  rtpm_description out{};
  copy(descriptor.model, out.model);
  copy(descriptor.serial, out.serial);
  copy(descriptor.frame, out.frame);
  out.rate_hz = descriptor.rate_hz;
  out.force_newton_max = descriptor.limits.force_newton_max;
  out.torque_newton_metre_max = descriptor.limits.torque_newton_metre_max;
  out.joint_count = static_cast<std::uint32_t>(descriptor.joints.size());
  out.output_count = static_cast<std::uint32_t>(descriptor.outputs.size());
  out.analog_count = static_cast<std::uint32_t>(descriptor.analogs.size());
  out.button_count = static_cast<std::uint32_t>(descriptor.buttons.size());
  out.force_end_us = std::chrono::ceil<std::chrono::microseconds>(force_end).count();
  return out;
}

}  // namespace

rtpm_status rtpm_device_open(rtpm_node* node, const char* name, const rtpm_device_options* options,
                             rtpm_device** device) {
  return c::guarded([&] {
    if (node == nullptr || name == nullptr || device == nullptr)
      return c::invalid("rtpm_device_open: node, name and device must not be NULL");
    const auto wanted = c::options_of(options, rtpm_device_options RTPM_DEVICE_OPTIONS_INIT);
    if (wanted.hold_us < 1000 || wanted.hold_us > 1'000'000)
      return c::invalid("hold_us is 1000 to 1000000, not " + std::to_string(wanted.hold_us));
    if (wanted.priority > Priority::kHighest)
      return c::invalid("priority is at most 32767, not " + std::to_string(wanted.priority));
    auto opened = gvd::DeviceClient::open(
        node->node, name,
        {.hold = c::span_of_us(wanted.hold_us), .patience = c::span_of_us(wanted.patience_us)});
    if (!opened) return c::failed(opened.error(), RTPM_UNREACHABLE);
    rpc::CallOptions calls;
    if (wanted.priority >= 0) calls.priority = Priority(wanted.priority);
    if (wanted.timeout_us > 0) calls.deadline = c::span_of_us(wanted.timeout_us);
    *device = new rtpm_device{name, std::move(*opened), calls};
    return rtpm_status{RTPM_OK};
  });
}

void rtpm_device_close(rtpm_device* device) {
  delete device;
}

rtpm_status rtpm_device_describe(rtpm_device* device, rtpm_description* description) {
  return c::guarded([&] {
    if (device == nullptr || !c::has_size(description))
      return c::invalid("rtpm_device_describe: device or description is NULL or not initialized");
    c::give(description, in_c(device->client.descriptor(), device->client.force_end()));
    return rtpm_status{RTPM_OK};
  });
}

rtpm_status rtpm_device_read(rtpm_device* device, rtpm_sample* sample) {
  return c::guarded([&] {
    if (device == nullptr || !c::has_size(sample))
      return c::invalid("rtpm_device_read: device or sample is NULL or not initialized");
    const auto read = device->client.read(device->options);
    if (!read) return c::failed(device->name + ": a reading", read.error());
    c::give(sample, in_c(*read));
    return rtpm_status{RTPM_OK};
  });
}

rtpm_status rtpm_device_acquire(rtpm_device* device, int64_t patience_us) {
  return request(device, "acquire",
                 [&](auto& client) { return client.acquire(c::span_of_us(patience_us)); });
}
rtpm_status rtpm_device_take_over(rtpm_device* device) {
  return request(device, "take_over", [](gvd::DeviceClient& client) {
    const MonotonicTime end = rt::now() + kTakeOverPatience;
    while (true) {
      const auto taken = client.take_over();
      const bool is_early = !taken && taken.error() == gvd::DeviceOutcome::kTooSoon;
      if (!is_early || rt::now() >= end) return taken;
      rt::sleep_until(rt::now() + kTakeOverInterval);
    }
  });
}
rtpm_status rtpm_device_renew(rtpm_device* device) {
  return request(device, "renew", [](auto& client) { return client.renew(); });
}
rtpm_status rtpm_device_release(rtpm_device* device) {
  return request(device, "release", [](auto& client) { return client.release(); });
}
rtpm_status rtpm_device_activate(rtpm_device* device) {
  return request(
      device, "activate", [](auto& client) { return client.activate(); },
      [](const auto& sample) { return sample.lifecycle == driver::Lifecycle::kActive; });
}
rtpm_status rtpm_device_deactivate(rtpm_device* device) {
  return request(
      device, "deactivate", [](auto& client) { return client.deactivate(); },
      [](const auto& sample) { return sample.lifecycle != driver::Lifecycle::kActive; });
}
rtpm_status rtpm_device_recover(rtpm_device* device) {
  return request(
      device, "recover", [](auto& client) { return client.recover(); },
      [](const auto& sample) {
        return !sample.faults.has(driver::Fault::kCommandNotFinite) &&
               !sample.faults.has(driver::Fault::kTooFast);
      });
}
rtpm_status rtpm_device_rearm(rtpm_device* device) {
  return request(
      device, "rearm", [](auto& client) { return client.rearm(); },
      [](const auto& sample) { return !sample.faults.has(driver::Fault::kEmergencyStop); });
}

// Without the lock: a stop waits for no other request.
rtpm_status rtpm_device_emergency_stop(rtpm_device* device) {
  return c::guarded([&] {
    if (device == nullptr) return c::invalid("rtpm_device_emergency_stop: device is NULL");
    return status_of(*device, "emergency stop", device->client.emergency_stop());
  });
}

rtpm_status rtpm_device_set_wrench(rtpm_device* device, const double force_newton[3],
                                   const double torque_newton_metre[3]) {
  return c::guarded([&] {
    if (device == nullptr || force_newton == nullptr)
      return c::invalid("rtpm_device_set_wrench: device and force_newton must not be NULL");
    const auto vector = [](const double* v) { return driver::Vector3{v[0], v[1], v[2]}; };
    driver::Wrench wrench{.force_newton = vector(force_newton)};
    if (torque_newton_metre != nullptr) wrench.torque_newton_metre = vector(torque_newton_metre);
    return set(*device, driver::Setpoint::with_wrench(wrench));
  });
}

rtpm_status rtpm_device_set_joints(rtpm_device* device, int32_t mode, const double* values,
                                   uint32_t count) {
  return c::guarded([&] {
    if (device == nullptr || values == nullptr)
      return c::invalid("rtpm_device_set_joints: device and values must not be NULL");
    if (mode < RTPM_JOINT_POSITION || mode > RTPM_JOINT_EFFORT)
      return c::invalid("mode takes RTPM_JOINT_POSITION, _VELOCITY or _EFFORT, not " +
                        std::to_string(mode));
    const std::size_t joints = device->client.descriptor().joints.size();
    if (count != joints) {
      return c::invalid(device->name + " has " + std::to_string(joints) + " joints, not " +
                        std::to_string(count));
    }
    driver::Setpoint setpoint;
    setpoint.mode = static_cast<driver::CommandMode>(mode);
    std::copy_n(values, count, setpoint.joints.begin());
    return set(*device, setpoint);
  });
}

rtpm_status rtpm_device_set_outputs(rtpm_device* device, const float* values, uint32_t count) {
  return c::guarded([&] {
    if (device == nullptr || values == nullptr)
      return c::invalid("rtpm_device_set_outputs: device and values must not be NULL");
    const std::size_t outputs = device->client.descriptor().outputs.size();
    if (count != outputs) {
      return c::invalid(device->name + " has " + std::to_string(outputs) + " outputs, not " +
                        std::to_string(count));
    }
    std::array<float, driver::kOutputCountMax> all{};
    std::copy_n(values, count, all.begin());
    return set(*device, driver::Setpoint::with_outputs(all));
  });
}
