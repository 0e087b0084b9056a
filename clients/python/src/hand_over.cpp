#include "hand_over.hpp"

#include <algorithm>

#include "rtpm/rpc/refusal.hpp"

namespace rtpm::python {

rpc::DispatchResult HandedOver::dispatch(std::uint16_t method_id, ConstBytes request,
                                         MutableBytes reply, const rpc::CallContext& context) {
  const auto& methods = service_.methods;
  const auto found = std::ranges::find(methods, method_id, &schema::Method::id);
  if (found == methods.end()) return {.status = wire::Status::kNoSuchMethod};
  Call call{.object = object_,
            .method = static_cast<std::size_t>(found - methods.begin()),
            .request = {request.begin(), request.end()},
            .deadline = context.deadline,
            .priority = context.priority,
            .trace_id = context.trace_id,
            .session = context.session,
            .caller = context.caller};
  if (context.identity != nullptr) call.caller_name = context.identity->name();
  if (found->is_stream) {
    call.items = context.deferral->stream();
  } else {
    call.reply = context.deferral->defer();
  }
  if (!call.reply && !call.items) {
    return rpc::refuse(wire::Status::kOverload, "too many calls wait for Python", reply);
  }
  workers_->put(std::move(call));
  return {};
}

}  // namespace rtpm::python
