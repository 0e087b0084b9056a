#include "servant.hpp"

#include <string>

#include "flight_wire.hpp"
#include "rtpm/gvd/models_wire.hpp"
#include "rtpm/gvd/wire.hpp"
#include "rtpm/rt/memory.hpp"

namespace rtpm::gvd {
namespace {

device::Outcome to_wire(const expected<void, DeviceOutcome>& done) noexcept {
  return gvd::to_wire(done ? DeviceOutcome::kDone : done.error());
}

device::Outcome for_holder(bool is_holder) noexcept {
  return device::Outcome{is_holder ? device::OutcomeCode::Done : device::OutcomeCode::NotHolder};
}

}  // namespace

rpc::Result<void> DeviceServant::describe(rpc::ReplyBuilder<device::Description>& reply,
                                          const rpc::CallContext&) {
  // Called once per bind, not in a loop.
  const rt::AllowAllocationScope set_up;
  const SafetyConfig& safety = cycle_.safety();
  reply.finish(to_wire(descriptor_,
                       {period_, safety.hold_max, safety.rest(), cycle_.config().operator_priority},
                       reply.builder()));
  return {};
}

rpc::Result<device::Sample> DeviceServant::read(const rpc::CallContext& context) {
  if (view_ != nullptr) return view_->on_read(context.received);
  return to_wire(cycle_.newest(context.received).value_or(driver::Sample{}));
}

rpc::Result<device::Outcome> DeviceServant::command(const device::Command& request,
                                                    const rpc::CallContext& context) {
  const auto taken = cycle_.submit(from_wire(request), context.received);
  if (view_ != nullptr) {
    view_->on_command(request, taken ? DeviceOutcome::kDone : taken.error(), context.received);
  }
  return to_wire(taken);
}

rpc::Result<device::Lease> DeviceServant::acquire(const rpc::CallContext&) {
  Lease& lease = cycle_.lease();
  if (lease.holder() != Lease::kNobody) return refused_to_wire(DeviceOutcome::kHeld);
  const auto id = lease.acquire();
  return id ? granted_to_wire(*id, lease.config()) : refused_to_wire(DeviceOutcome::kTooSoon);
}

rpc::Result<device::Outcome> DeviceServant::renew(const device::Holder& request,
                                                  const rpc::CallContext&) {
  return for_holder(cycle_.lease().renew(request.lease()));
}

rpc::Result<device::Outcome> DeviceServant::release(const device::Holder& request,
                                                    const rpc::CallContext&) {
  return for_holder(cycle_.lease().release(request.lease()));
}

rpc::Result<device::Outcome> DeviceServant::recover(const device::Holder& request,
                                                    const rpc::CallContext&) {
  return to_wire(cycle_.request(request.lease(), Release::kRecover));
}

rpc::Result<device::Outcome> DeviceServant::activate(const device::Holder& request,
                                                     const rpc::CallContext&) {
  return to_wire(cycle_.request(request.lease(), Transition::kActivate));
}

rpc::Result<device::Outcome> DeviceServant::deactivate(const device::Holder& request,
                                                       const rpc::CallContext&) {
  return to_wire(cycle_.request(request.lease(), Transition::kDeactivate));
}

rpc::Result<device::Outcome> DeviceServant::emergency_stop(const device::Stop& request,
                                                           const rpc::CallContext&) {
  // A scope of a later version stops at least this device.
  cycle_.emergency_stop();
  EmergencyStops* const others = cycle_.config().emergency_stops;
  if (request.scope() == device::StopScope::Server && others != nullptr) others->stop_devices();
  if (request.scope() == device::StopScope::System &&
      (others == nullptr || !others->stop_system())) {
    return device::Outcome{device::OutcomeCode::NotInSystem};
  }
  return device::Outcome{device::OutcomeCode::Done};
}

rpc::Result<device::Outcome> DeviceServant::rearm(const device::Holder& request,
                                                  const rpc::CallContext&) {
  return to_wire(cycle_.request(request.lease(), Release::kRearm));
}

rpc::Result<device::Lease> DeviceServant::take_over(const rpc::CallContext& context) {
  const auto id = cycle_.take_over(context.priority);
  return id ? granted_to_wire(*id, cycle_.lease().config().of_operator())
            : refused_to_wire(id.error());
}

rpc::Result<device::LeaseStanding> DeviceServant::lease_state(const device::Holder& request,
                                                              const rpc::CallContext&) {
  return device::LeaseStanding{static_cast<std::uint8_t>(cycle_.lease().state_of(request.lease()))};
}

rpc::Result<void> DeviceServant::set_models(const device::SetModelsRequest& request,
                                            rpc::ReplyBuilder<device::SetModelsReply>& reply,
                                            const rpc::CallContext&) {
  // Rare, and refusals include text.
  const rt::AllowAllocationScope set_up;
  device::Outcome outcome{device::OutcomeCode::Done};
  std::string words;
  if (const auto list = from_wire(request); !list) {
    outcome = device::Outcome{device::OutcomeCode::OutOfRange};
    words = list.error();
  } else if (const auto set = cycle_.set_models({request.lease(), request.sequence(), *list});
             !set) {
    outcome = device::Outcome{static_cast<device::OutcomeCode>(set.error().outcome)};
    if (set.error().error) words = to_text(*set.error().error);
  }
  flatbuffers::FlatBufferBuilder& builder = reply.builder();
  const auto words_at =
      words.empty() ? flatbuffers::Offset<flatbuffers::String>{} : builder.CreateString(words);
  reply.finish(device::CreateSetModelsReply(builder, &outcome, words_at));
  return {};
}

rpc::Result<void> DeviceServant::read_flight_record(
    const device::FlightRecordRequest& request, rpc::ReplyBuilder<device::FlightRecordReply>& reply,
    const rpc::CallContext&) {
  // Only called by people after a fault, so it may allocate.
  const rt::AllowAllocationScope set_up;
  reply.finish(
      to_wire(cycle_.flight_recorder().newest(request.first(), kFlightPageSize), reply.builder()));
  return {};
}

}  // namespace rtpm::gvd
