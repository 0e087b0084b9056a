#include "execution/execution.hpp"

#include <algorithm>
#include <string>
#include <utility>

#include "model/lane_table_owner.hpp"
#include "rtpm/base/assert.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/memory.hpp"
#include "rtpm/rt/priority.hpp"

namespace rtpm::rpc {

expected<void, SetupError> Execution::start(rt::RealtimeMode realtime, rt::CpuKeeper* keeper) {
  realtime_ = realtime;
  keeper_ = keeper;
  if (parts_.config.wait.strategy == rt::WaitStrategy::kSpin) {
    if (auto possible = rt::check_spinning(thread_config(0)); !possible) return possible;
  }
  return start_threads();
}

rt::ThreadConfig Execution::thread_config(std::uint32_t index) const {
  rt::ThreadConfig config;
  config.name = parts_.config.name;
  if (index > 0) config.name += "/" + std::to_string(index);
  config.priority = parts_.config.priority;
  config.cpus = parts_.config.cpus;
  config.realtime = realtime_;
  config.schedule = parts_.config.schedule;
  return config;
}

void Execution::sleep(Lead&, MonotonicTime until) noexcept {
  keep_cpu_awake(until);
  rt::sleep_until(until);
}

void Execution::keep_cpu_awake(MonotonicTime until) const noexcept {
  // Waking up takes time, during which the CPU must stay awake, too.
  constexpr Duration kLatenessMax = std::chrono::microseconds{200};
  if (keeper_ != nullptr) keeper_->keep_until(until + kLatenessMax);
}

ConstBytes Execution::run_now(Lead& lead, wire::ServerSessions& sessions,
                              const wire::Request& request) noexcept {
  if (request.wants_receipt()) return run_confirmed(lead, sessions, request);
  if (sessions.is_short_of_buffers(request, request.received)) {
    return run_without_buffer(lead, sessions, request);
  }
  const MutableBytes reply = sessions.reply_buffer(request, request.received);
  CallDeferral deferral(parts_.calls.pool(), request, sessions);
  const DispatchResult result = serve(lead, sessions, request, reply, deferral);
  RTPM_ASSERT(result.reply_size <= reply.size(), "a reply stays within its buffer");
  return complete(lead, sessions, request, deferral, result);
}

ConstBytes Execution::complete(Lead& lead, wire::ServerSessions& sessions,
                               const wire::Request& request, const CallDeferral& deferral,
                               DispatchResult result) noexcept {
  if (deferral.is_taken()) {
    ++parts_.report.counters(lead).deferred_count;
    return {};
  }
  const MonotonicTime now = rt::now();
  parts_.report.on_answered(lead, now);
  parts_.report.on_end(lead, request, result.status, now);
  return sessions.complete(request, result.status, result.reply_size, now);
}

// Runs a call whose large reply will have to wait for a buffer. If it could not wait either, the
// call is refused before it runs.
ConstBytes Execution::run_without_buffer(Lead& lead, wire::ServerSessions& sessions,
                                         const wire::Request& request) noexcept {
  PendingCall* const call = parts_.calls.pool()->keep(sessions, request);
  if (call == nullptr) {
    ++parts_.report.counters(lead).overload_count;
    return sessions.complete(request, wire::Status::kOverload, 0, request.received);
  }
  const std::size_t size_max = sessions.reply_size_max(request);
  call->reply = call->reply_room.first(std::min(call->reply_room.size(), size_max));
  CallDeferral deferral(parts_.calls.pool(), request, sessions, call);
  const DispatchResult result = serve(lead, sessions, request, call->reply, deferral);
  parts_.report.on_answered(lead, rt::now());
  if (deferral.is_taken()) {
    ++parts_.report.counters(lead).deferred_count;
    return {};
  }
  RTPM_ASSERT(result.reply_size <= call->reply.size(), "a reply stays within its buffer");
  call->status = result.status;
  call->size = result.reply_size;
  call->is_ended.store(true, std::memory_order_release);
  parts_.calls.serve(lead, *call);
  return {};
}

// hp-5.8-3: the caller continues as soon as its call is certain to run.
ConstBytes Execution::run_confirmed(Lead& lead, wire::ServerSessions& sessions,
                                    const wire::Request& request) noexcept {
  const auto target = parts_.dispatch.target_of(request, &sessions);
  const wire::Status status = target ? wire::Status::kOk : target.error();
  const auto peer = sessions.peer_of(request);
  RTPM_ASSERT(peer.has_value(), "a request that just came has a session");
  parts_.calls.send(lead, sessions, *peer, sessions.accept(request, status, rt::now()));
  const MutableBytes reply = sessions.reply_buffer(request, request.received);
  CallDeferral deferral(parts_.calls.pool(), request, sessions);
  DispatchResult result;
  if (target) result = run_method(lead, *target, request, reply, deferral);
  return complete(lead, sessions, request, deferral, {result.status, 0});
}

DispatchResult Execution::serve(Lead& lead, wire::ServerSessions& sessions,
                                const wire::Request& request, MutableBytes reply,
                                CallDeferral& deferral) noexcept {
  if (request.header.service == wire::kSessionService) {
    return parts_.dispatch.serve_session(request, sessions, reply);
  }
  const auto target = parts_.dispatch.target_of(request, &sessions);
  if (!target) return {target.error(), 0};
  return run_method(lead, *target, request, reply, deferral);
}

DispatchResult Execution::run_method(Lead& lead, const Target& target, const wire::Request& request,
                                     MutableBytes reply, CallDeferral& deferral) noexcept {
  ServerCounters& counters = parts_.report.counters(lead);
  ++counters.call_count;
  parts_.idling.on_call(request.header.session, request.received);
  const Ran ran = parts_.dispatch.run(target, request, reply, deferral);
  if (ran.has_thrown) ++counters.servant_failure_count;
  if (ran.result.status == wire::Status::kBadRequest) ++counters.bad_request_count;
  // The lane keeps waiting at the request's priority, unless that is below its own. So a caller
  // with a constant priority causes no syscall between calls.
  if (rt::current_priority() < parts_.config.priority) rt::adopt_priority(parts_.config.priority);
  return ran.result;
}

expected<void, SetupError> SoloExecution::start_threads() {
  auto thread = rt::Thread::start(thread_config(0), [this] {
    BusyMark::show_at(&parts_.slot.busy_since_ns.front());
    const rt::NoAllocationScope no_allocation;
    Lead lead;
    parts_.cycle.serve(lead);
  });
  if (!thread) return unexpected{thread.error()};
  thread_ = std::move(*thread);
  return {};
}

void SoloExecution::accept(Lead& lead, LocalChannel& channel) noexcept {
  const wire::Request request = request_of(channel);
  const auto target = parts_.dispatch.target_of(request, nullptr);
  if (!target) return channel.finish(target.error(), 0);
  if (request.received >= request.deadline) {
    ++parts_.report.counters(lead).late_count;
    return channel.finish(wire::Status::kExpired, 0);
  }
  CallDeferral deferral(parts_.calls.pool(), request, channel);
  const DispatchResult result = run_method(lead, *target, request, channel.reply(), deferral);
  const MonotonicTime now = rt::now();
  if (deferral.is_taken()) {
    ++parts_.report.counters(lead).deferred_count;
  } else {
    parts_.report.on_end(lead, request, result.status, now);
    channel.finish(result.status, result.reply_size);
  }
  parts_.report.on_answered(lead, now);
  parts_.report.end_cycle(lead, request.received);
}

}  // namespace rtpm::rpc
