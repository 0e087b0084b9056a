#include <algorithm>

#include "client/binding_impl.hpp"
#include "client/node_impl.hpp"
#include "local/current_call.hpp"

// How a binding calls an object of its own program.
namespace rtpm::rpc {
namespace {

expected<LocalChannel*, CallError> place_of(LocalGate& gate) noexcept {
  LocalChannel* const place = gate.take_place();
  if (place == nullptr) return unexpected{CallError::kOverload};
  return place;
}

}  // namespace

std::optional<expected<ReplyLease, CallError>> Binding::Impl::call_locally(
    const Bound& to, const Plan& plan, ConstBytes request) noexcept {
  // Receipts and pings concern the transport, which a local call bypasses.
  if (plan.target != Target::kObject || plan.delivery == wire::Delivery::kReceipt) return {};
  const LocalDoor& door = *to.destination->door;
  const Priority priority = priority_of(plan, to);
  LocalGate* const gate = door.gate_of(priority);
  if (gate == nullptr) return unexpected{CallError::kPriorityNotAllowed};
  // The server has stopped; another one may be at its address now.
  if (gate->is_closed()) return {};
  const bool is_oneway = plan.delivery == wire::Delivery::kSent;
  const auto taken = is_oneway && gate->has_places_for(request.size())
                         ? place_of(*gate)
                         : node_.impl().local_channels.take();
  if (!taken) return unexpected{taken.error()};
  LocalChannel& channel = **taken;
  LocalCallParameters parameters;
  parameters.service = to.service;
  parameters.method = plan.method;
  parameters.priority = priority;
  parameters.session = local_session_;
  parameters.trace_id = plan.trace_id;
  parameters.deadline = plan.deadline;
  parameters.message_size_max = std::min(door.message_size_max(), node_.config().message_size_max);
  if (!channel.write(parameters, request)) {
    channel.give_up();
    return unexpected{CallError::kTooLarge};
  }
  if (is_oneway) {
    gate->submit(channel, /*is_awaited=*/false);
    return ReplyLease(ConstBytes{}, nullptr);
  }
  wire::Status status{};
  ConstBytes result;
  if (CurrentCall::host() == &gate->host()) {
    // This thread is the one that would run the call.
    const DispatchResult nested = gate->host().run_nested(channel);
    status = nested.status;
    result = ConstBytes(channel.reply()).first(nested.reply_size);
  } else {
    gate->submit(channel, /*is_awaited=*/true);
    if (!channel.wait(node_.config().wait)) return unexpected{CallError::kTimeout};
    status = channel.status();
    result = channel.result();
  }
  if (status == wire::Status::kOk) return ReplyLease(result, channel);
  const CallError error = refused(status, result);
  channel.release();
  return unexpected{error};
}

}  // namespace rtpm::rpc
