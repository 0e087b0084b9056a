#include <algorithm>

#include "client/bind_attempt.hpp"
#include "client/binding_impl.hpp"
#include "local/current_call.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/priority.hpp"

// How a binding calls: takes a channel, opens a session, binds again after a server's restart, and
// handles a lost session.
namespace rtpm::rpc {

ReplyLease::~ReplyLease() {
  if (channel_ != nullptr) channel_->release();
  if (local_ != nullptr) local_->release();
}

Binding::Impl::Plan Binding::Impl::plan(const MethodDescriptor& method,
                                        const CallOptions& options) const noexcept {
  const Duration usual =
      method.default_deadline > Duration{0} ? method.default_deadline : default_deadline_;
  const MonotonicTime now = rt::now();
  MonotonicTime deadline = deadline_after(options.deadline.value_or(usual), now);
  // After that the outer call's caller no longer waits.
  const CallContext* const outer = CurrentCall::get();
  if (outer != nullptr && !options.deadline) deadline = std::min(deadline, outer->deadline);
  return {
      .method = method.id,
      .is_idempotent = method.is_idempotent,
      .wanted = options.priority ? options.priority : rt::current_priority(),
      .trace_id = options.trace_id == 0 && outer != nullptr ? outer->trace_id : options.trace_id,
      .begun = now,
      .deadline = deadline};
}

expected<void, CallError> Binding::Impl::make_ready(const Plan& plan, MonotonicTime now,
                                                    Ready& ready) noexcept {
  ready.now = now;
  for (int round = 0; round < kRoundCountMax; ++round) {
    const Destinations::Pin pin(destinations_);
    const Bound last = destinations_.get();
    const Priority priority = priority_of(plan, last);
    auto taken = last.destination->endpoint.take(priority);
    if (!taken) return unexpected{taken.error()};
    TakenChannel channel(*taken);
    if (auto made = make_ready_on(*channel, last, priority, plan, ready); !made) return made;
    if (ready.channel == nullptr) continue;
    static_cast<void>(channel.keep());
    return {};
  }
  return unexpected{CallError::kPeerRestarted};
}

expected<void, CallError> Binding::Impl::make_ready_on(CallChannel& channel, const Bound& last,
                                                       Priority priority, const Plan& plan,
                                                       Ready& ready) noexcept {
  if (!channel.is_ready(priority)) {
    if (auto made = channel.make_ready(priority, plan.deadline); !made) {
      return unexpected{note_failure(made.error())};
    }
    ready.now = rt::now();
  }
  std::uint32_t service = last.service;
  if (channel.server_epoch() != last.server_epoch) {
    // The server restarted, so the object's number may now belong to another object (hp-6.1-4).
    const BindOutcome again = ask_for_object(*last.destination, interface_, last.fingerprint,
                                             channel, priority, plan.deadline);
    ready.now = rt::now();
    if (again.kind == CallOutcome::Kind::kLost) return {};
    if (again.kind == CallOutcome::Kind::kFailed || again.status != wire::Status::kOk) {
      return unexpected{note_failure(again.error)};
    }
    // The name may now have the server's new address.
    ask_for_name();
    destinations_.renew(again.bound);
    service = again.bound.service;
  }
  ready.channel = &channel;
  ready.server_epoch = channel.server_epoch();
  ready.parameters.service = plan.target == Target::kSession ? wire::kSessionService : service;
  ready.parameters.method = plan.method;
  ready.parameters.priority = priority;
  ready.parameters.trace_id = plan.trace_id;
  ready.parameters.deadline = plan.deadline;
  ready.parameters.delivery = plan.delivery;
  ready.parameters.stream_window = plan.stream_window;
  ready.parameters.stream_silence = plan.stream_silence;
  ready.parameters.stream_lease = plan.stream_pause_max.value_or(channel.stream_pause_max());
  return {};
}

expected<void, CallError> Binding::Impl::judge(const CallOutcome& outcome, const Ready& ready,
                                               const Plan& plan, MonotonicTime begun) noexcept {
  // In any case the call was sent, so its error stays.
  static_cast<void>(note_failure(outcome.error));
  if (outcome.kind == CallOutcome::Kind::kFailed) {
    if (outcome.error == CallError::kDisconnected && plan.is_idempotent) return {};
    return unexpected{outcome.error};
  }
  if (plan.is_idempotent) return {};
  // hp-5.5-2: the session is gone. The same server drops only sessions that were silent for long,
  // so it has not seen this call. A restarted one may have run it before.
  if (auto again = ready.channel->make_ready(ready.parameters.priority, plan.deadline); !again) {
    return unexpected{again.error() == CallError::kTimeout ? CallError::kTimeout : outcome.error};
  }
  // hp-4.5-2: The call may have run before the server closed the session.
  const std::uint64_t epoch = ready.channel->server_epoch();
  if (outcome.error == CallError::kStopped && epoch == ready.server_epoch) {
    return unexpected{outcome.error};
  }
  if (!wire::has_not_run(ready.server_epoch, epoch, begun, rt::now())) {
    return unexpected{CallError::kPeerRestarted};
  }
  return {};
}

Priority Binding::Impl::priority_of(const Plan& plan, const Bound& to) const noexcept {
  const Priority priority = to.is_server_declared || !plan.wanted ? to.priority : *plan.wanted;
  const PriorityTransform transform = node_.config().outbound_priority;
  return transform == nullptr ? priority : transform(priority, to.destination->path);
}

expected<ReplyLease, CallError> Binding::Impl::call(const Plan& plan, ConstBytes request) noexcept {
  if (destinations_.has_door()) {
    const Destinations::Pin pin(destinations_);
    const Bound to = destinations_.get();
    if (to.destination->door) {
      if (auto outcome = call_locally(to, plan, request)) return std::move(*outcome);
    }
  }
  return call_over_transport(plan, request);
}

expected<ReplyLease, CallError> Binding::Impl::call_over_transport(const Plan& plan,
                                                                   ConstBytes request) noexcept {
  const bool is_sent = plan.delivery == wire::Delivery::kSent;
  if (is_sent && destinations_.has_lost_oneways()) return unexpected{CallError::kMaybeLost};
  MonotonicTime now = plan.begun;
  for (int round = 0; round < kRoundCountMax; ++round, now = rt::now()) {
    Ready ready;
    if (auto made = make_ready(plan, now, ready); !made) return unexpected{made.error()};
    TakenChannel channel(ready.channel);
    if (is_sent) destinations_.note_oneway();
    const CallOutcome outcome = channel->call(ready.parameters, request, ready.now);
    if (outcome.kind == CallOutcome::Kind::kReply) {
      if (outcome.status != wire::Status::kOk)
        return unexpected{refused(outcome.status, outcome.payload)};
      return expected<ReplyLease, CallError>(std::in_place, outcome.payload, channel.keep());
    }
    if (outcome.kind == CallOutcome::Kind::kUnsent) {
      if (destinations_.has_lost_oneways()) return unexpected{CallError::kMaybeLost};
      continue;
    }
    if (auto again = judge(outcome, ready, plan, channel->call_begun()); !again) {
      return unexpected{again.error()};
    }
  }
  return unexpected{is_sent ? CallError::kUnreachable : CallError::kPeerRestarted};
}

expected<ReplyLease, CallError> Binding::Impl::call_again(const CallOutcome& outcome,
                                                          const Ready& ready, const Plan& plan,
                                                          MonotonicTime begun,
                                                          ConstBytes request) noexcept {
  if (auto again = judge(outcome, ready, plan, begun); !again) return unexpected{again.error()};
  return call(plan, request);
}

}  // namespace rtpm::rpc
