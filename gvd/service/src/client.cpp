#include "rtpm/gvd/client.hpp"

#include <algorithm>
#include <atomic>
#include <string>
#include <utility>

#include "command_lease.hpp"
#include "rtpm/gvd/lease.hpp"
#include "rtpm/rt/clock.hpp"
#include "wire.hpp"

namespace rtpm::gvd {
namespace {

constexpr Duration kAcquireRetry = std::chrono::milliseconds{20};

Duration from_us(std::uint32_t us) noexcept {
  return std::chrono::microseconds{us};
}

}  // namespace

struct DeviceClient::Impl {
  Impl(device::DeviceClient bound, const device::Description& description, Duration hold_wanted)
      : stub(std::move(bound)),
        descriptor(from_wire(description)),
        hold(std::clamp(hold_wanted, Duration{0}, from_us(description.hold_us_max()))),
        operator_priority(std::min<int>(description.operator_priority(), Priority::kHighest)) {
    const Duration period = std::chrono::duration_cast<Duration>(
        std::chrono::duration<double>(1.0 / std::max(descriptor.rate_hz, 1.0)));
    force_end = hold + from_us(description.ramp_us()) + period;
  }
  ~Impl() { static_cast<void>(release()); }

  [[nodiscard]] device::Holder holder() const noexcept {
    return device::Holder{lease.load(std::memory_order_relaxed)};
  }
  expected<void, rpc::CallError> hold_lease(
      const expected<device::Lease, rpc::CallError>& granted) {
    if (!granted) return unexpected{granted.error()};
    lease.store(granted->id(), std::memory_order_relaxed);
    return {};
  }
  expected<void, rpc::CallError> release() {
    const std::uint64_t held = lease.exchange(Lease::kNobody, std::memory_order_relaxed);
    if (held == Lease::kNobody) return {};
    return stub.release(device::Holder{held});
  }

  device::DeviceClient stub;
  driver::Descriptor descriptor;
  Duration hold;
  Duration force_end{};
  Priority operator_priority;
  std::atomic<std::uint64_t> lease{Lease::kNobody};
  std::atomic<std::uint32_t> sequence{1};
};

expected<DeviceClient, SetupError> DeviceClient::open(rpc::Node& node, std::string_view device,
                                                      const DeviceClientOptions& options) {
  auto stub = device::DeviceClient::bind(node, device, options.bind);
  if (!stub) return unexpected{stub.error()};
  rpc::CallOptions call;
  call.deadline = options.bind.deadline;
  std::unique_ptr<Impl> impl;
  {
    const auto description = stub->describe({}, call);
    if (!description) {
      return setup_error("device " + std::string(device) + " was found, but not described",
                         description.error());
    }
    impl = std::make_unique<Impl>(std::move(*stub), **description, options.hold);
  }
  return DeviceClient{std::move(impl)};
}

DeviceClient::DeviceClient(std::unique_ptr<Impl> impl) noexcept : impl_(std::move(impl)) {}
DeviceClient::DeviceClient(DeviceClient&&) noexcept = default;
DeviceClient& DeviceClient::operator=(DeviceClient&&) noexcept = default;
DeviceClient::~DeviceClient() = default;

const driver::Descriptor& DeviceClient::descriptor() const noexcept {
  return impl_->descriptor;
}
std::string DeviceClient::url() const {
  return impl_->stub.binding().url();
}
Duration DeviceClient::force_end() const noexcept {
  return impl_->force_end;
}
Priority DeviceClient::operator_priority() const noexcept {
  return impl_->operator_priority;
}

expected<driver::Sample, rpc::CallError> DeviceClient::read(
    const rpc::CallOptions& options) noexcept {
  const auto sample = impl_->stub.read({}, options);
  if (!sample) return unexpected{sample.error()};
  return from_wire(*sample);
}

expected<void, rpc::CallError> DeviceClient::set_force(const driver::Vector3& force_newton,
                                                       const rpc::CallOptions& options) noexcept {
  return set_wrench({force_newton, {}}, options);
}

expected<void, rpc::CallError> DeviceClient::set_wrench(const driver::Wrench& wrench,
                                                        const rpc::CallOptions& options) noexcept {
  const auto hold_us = std::chrono::duration_cast<std::chrono::microseconds>(impl_->hold).count();
  const device::Command command{to_wire(wrench.force_newton), to_wire(wrench.torque_newton_metre),
                                impl_->lease.load(std::memory_order_relaxed),
                                impl_->sequence.fetch_add(1, std::memory_order_relaxed),
                                static_cast<std::uint32_t>(hold_us)};
  return impl_->stub.command(command, options);
}

expected<void, rpc::CallError> DeviceClient::acquire(Duration patience) {
  const MonotonicTime until = rt::now() + patience;
  while (true) {
    const auto acquired = impl_->hold_lease(impl_->stub.acquire());
    if (acquired || acquired.error() != rpc::CallError::kNotLeaseHolder) return acquired;
    const MonotonicTime next = rt::now() + kAcquireRetry;
    if (next > until) return acquired;
    rt::sleep_until(next);
  }
}
expected<void, rpc::CallError> DeviceClient::take_over(std::optional<Priority> priority) {
  rpc::CallOptions options;
  options.priority = priority.value_or(impl_->operator_priority);
  return impl_->hold_lease(impl_->stub.take_over({}, options));
}
expected<LeaseState, rpc::CallError> DeviceClient::lease_state() {
  const auto standing = impl_->stub.lease_state(impl_->holder());
  if (!standing) return unexpected{standing.error()};
  return standing->state() < kLeaseStateCount ? static_cast<LeaseState>(standing->state())
                                              : LeaseState::kUnknown;
}
expected<void, rpc::CallError> DeviceClient::renew() {
  return impl_->stub.renew(impl_->holder());
}
expected<void, rpc::CallError> DeviceClient::release() {
  return impl_->release();
}
expected<void, rpc::CallError> DeviceClient::recover() {
  return impl_->stub.recover(impl_->holder());
}
expected<void, rpc::CallError> DeviceClient::activate() {
  return impl_->stub.activate(impl_->holder());
}
expected<void, rpc::CallError> DeviceClient::deactivate() {
  return impl_->stub.deactivate(impl_->holder());
}

}  // namespace rtpm::gvd
