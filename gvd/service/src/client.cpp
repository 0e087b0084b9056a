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

class DeviceClient::Impl {
 public:
  Impl(device::DeviceClient stub, const device::Description& description, Duration hold)
      : stub_(std::move(stub)),
        descriptor_(from_wire(description)),
        hold_(std::clamp(hold, Duration{0}, from_us(description.hold_us_max()))),
        operator_priority_(std::min<int>(description.operator_priority(), Priority::kHighest)) {
    const Duration period = std::chrono::duration_cast<Duration>(
        std::chrono::duration<double>(1.0 / std::max(descriptor_.rate_hz, 1.0)));
    force_end_ = hold_ + from_us(description.ramp_us()) + period;
  }
  ~Impl() { static_cast<void>(release()); }

  [[nodiscard]] device::DeviceClient& stub() noexcept { return stub_; }
  [[nodiscard]] const driver::Descriptor& descriptor() const noexcept { return descriptor_; }
  [[nodiscard]] Duration force_end() const noexcept { return force_end_; }
  [[nodiscard]] Priority operator_priority() const noexcept { return operator_priority_; }
  [[nodiscard]] device::Holder holder() const noexcept {
    return device::Holder{lease_.load(std::memory_order_relaxed)};
  }

  expected<void, rpc::CallError> set_wrench(const driver::Wrench& wrench,
                                            const rpc::CallOptions& options) noexcept {
    const auto hold_us = std::chrono::duration_cast<std::chrono::microseconds>(hold_).count();
    const device::Command command{to_wire(wrench.force_newton), to_wire(wrench.torque_newton_metre),
                                  lease_.load(std::memory_order_relaxed),
                                  sequence_.fetch_add(1, std::memory_order_relaxed),
                                  static_cast<std::uint32_t>(hold_us)};
    return stub_.command(command, options);
  }

  expected<void, rpc::CallError> acquire(Duration patience) {
    const MonotonicTime until = rt::now() + patience;
    while (true) {
      const auto lease = stub_.acquire();
      if (lease) {
        lease_.store(lease->id(), std::memory_order_relaxed);
        return {};
      }
      const MonotonicTime next = rt::now() + kAcquireRetry;
      if (lease.error() != rpc::CallError::kNotLeaseHolder || next > until) {
        return unexpected{lease.error()};
      }
      rt::sleep_until(next);
    }
  }

  expected<void, rpc::CallError> take_over(Priority priority) {
    rpc::CallOptions options;
    options.priority = priority;
    const auto lease = stub_.take_over({}, options);
    if (!lease) return unexpected{lease.error()};
    lease_.store(lease->id(), std::memory_order_relaxed);
    return {};
  }

  expected<LeaseState, rpc::CallError> lease_state() {
    const auto standing = stub_.lease_state(holder());
    if (!standing) return unexpected{standing.error()};
    return standing->state() < kLeaseStateCount ? static_cast<LeaseState>(standing->state())
                                                : LeaseState::kUnknown;
  }

  expected<void, rpc::CallError> release() {
    const std::uint64_t lease = lease_.exchange(Lease::kNobody, std::memory_order_relaxed);
    if (lease == Lease::kNobody) return {};
    return stub_.release(device::Holder{lease});
  }

 private:
  device::DeviceClient stub_;
  driver::Descriptor descriptor_;
  Duration hold_;
  Duration force_end_{};
  Priority operator_priority_;
  std::atomic<std::uint64_t> lease_{Lease::kNobody};
  std::atomic<std::uint32_t> sequence_{1};
};

expected<DeviceClient, rpc::SetupError> DeviceClient::open(rpc::Node& node, std::string_view device,
                                                           const DeviceClientOptions& options) {
  auto stub = device::DeviceClient::bind(node, device, options.bind);
  if (!stub) return unexpected{stub.error()};
  rpc::CallOptions call;
  call.deadline = options.bind.deadline;
  std::unique_ptr<Impl> impl;
  {
    const auto description = stub->describe({}, call);
    if (!description) {
      return rpc::setup_error("device " + std::string(device) + " was found, but did not say " +
                              "what it is: " + std::string(to_string(description.error())));
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
  return impl_->descriptor();
}
std::string DeviceClient::url() const {
  return impl_->stub().binding().url();
}
Duration DeviceClient::force_end() const noexcept {
  return impl_->force_end();
}
Priority DeviceClient::operator_priority() const noexcept {
  return impl_->operator_priority();
}

expected<driver::Sample, rpc::CallError> DeviceClient::read(
    const rpc::CallOptions& options) noexcept {
  const auto sample = impl_->stub().read({}, options);
  if (!sample) return unexpected{sample.error()};
  return from_wire(*sample);
}

expected<void, rpc::CallError> DeviceClient::set_force(const driver::Vector3& force_newton,
                                                       const rpc::CallOptions& options) noexcept {
  return impl_->set_wrench({force_newton, {}}, options);
}

expected<void, rpc::CallError> DeviceClient::set_wrench(const driver::Wrench& wrench,
                                                        const rpc::CallOptions& options) noexcept {
  return impl_->set_wrench(wrench, options);
}

expected<void, rpc::CallError> DeviceClient::acquire(Duration patience) {
  return impl_->acquire(patience);
}
expected<void, rpc::CallError> DeviceClient::take_over(std::optional<Priority> priority) {
  return impl_->take_over(priority.value_or(impl_->operator_priority()));
}
expected<LeaseState, rpc::CallError> DeviceClient::lease_state() {
  return impl_->lease_state();
}
expected<void, rpc::CallError> DeviceClient::renew() {
  return impl_->stub().renew(impl_->holder());
}
expected<void, rpc::CallError> DeviceClient::release() {
  return impl_->release();
}
expected<void, rpc::CallError> DeviceClient::recover() {
  return impl_->stub().recover(impl_->holder());
}
expected<void, rpc::CallError> DeviceClient::activate() {
  return impl_->stub().activate(impl_->holder());
}
expected<void, rpc::CallError> DeviceClient::deactivate() {
  return impl_->stub().deactivate(impl_->holder());
}

}  // namespace rtpm::gvd
