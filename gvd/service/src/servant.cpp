#include "servant.hpp"

#include "rtpm/rt/memory.hpp"
#include "wire.hpp"

namespace rtpm::gvd {
namespace {

rpc::Result<void> for_holder(bool is_holder) noexcept {
  if (!is_holder) return unexpected{rpc::Refusal::kNotLeaseHolder};
  return {};
}

std::uint64_t to_us(Duration duration) noexcept {
  return static_cast<std::uint64_t>(
      std::chrono::duration_cast<std::chrono::microseconds>(duration).count());
}

device::Lease to_wire(std::uint64_t id, const LeaseConfig& config) noexcept {
  return {id, to_us(config.silence_max), to_us(config.idle_max)};
}

}  // namespace

rpc::Result<void> DeviceServant::describe(rpc::ReplyBuilder<device::Description>& reply,
                                          const rpc::CallContext&) {
  // Called once per bind, not in a loop.
  const rt::AllowAllocationScope set_up;
  const SafetyConfig& safety = cycle_.safety();
  reply.finish(to_wire(descriptor_,
                       {period_, safety.hold_max, safety.ramp, cycle_.config().operator_priority},
                       reply.builder()));
  return {};
}

rpc::Result<device::Sample> DeviceServant::read(const rpc::CallContext&) {
  const auto sample = cycle_.newest();
  if (!sample) return unexpected{rpc::Refusal::kGone};
  return to_wire(*sample);
}

rpc::Result<void> DeviceServant::command(const device::Command& request,
                                         const rpc::CallContext& context) {
  ForceCommand command;
  command.lease = request.lease();
  command.sequence = request.sequence();
  command.hold = std::chrono::microseconds{request.hold_us()};
  command.wrench = {from_wire(request.force_newton()), from_wire(request.torque_newton_metre())};
  return cycle_.submit(command, context.received);
}

rpc::Result<device::Lease> DeviceServant::acquire(const rpc::CallContext&) {
  Lease& lease = cycle_.lease();
  const auto id = lease.acquire();
  if (!id) return unexpected{rpc::Refusal::kNotLeaseHolder};
  return to_wire(*id, lease.config());
}

rpc::Result<void> DeviceServant::renew(const device::Holder& request, const rpc::CallContext&) {
  return for_holder(cycle_.lease().renew(request.lease()));
}

rpc::Result<void> DeviceServant::release(const device::Holder& request, const rpc::CallContext&) {
  return for_holder(cycle_.lease().release(request.lease()));
}

rpc::Result<void> DeviceServant::recover(const device::Holder& request, const rpc::CallContext&) {
  return cycle_.request_recovery(request.lease());
}

rpc::Result<void> DeviceServant::activate(const device::Holder& request, const rpc::CallContext&) {
  return cycle_.request(request.lease(), Transition::kActivate);
}

rpc::Result<void> DeviceServant::deactivate(const device::Holder& request,
                                            const rpc::CallContext&) {
  return cycle_.request(request.lease(), Transition::kDeactivate);
}

rpc::Result<device::Lease> DeviceServant::take_over(const rpc::CallContext& context) {
  const auto id = cycle_.take_over(context.priority);
  if (!id) return unexpected{id.error()};
  return to_wire(*id, cycle_.lease().config());
}

rpc::Result<device::LeaseStanding> DeviceServant::lease_state(const device::Holder& request,
                                                              const rpc::CallContext&) {
  return device::LeaseStanding{static_cast<std::uint8_t>(cycle_.lease().state_of(request.lease()))};
}

}  // namespace rtpm::gvd
