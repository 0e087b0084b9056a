#include "calls/dispatch.hpp"

#include <charconv>
#include <exception>
#include <string_view>

#include "calls/deferral.hpp"
#include "calls/refusal_notes.hpp"
#include "local/current_call.hpp"
#include "model/lane_table_owner.hpp"
#include "rtpm/rpc/refusal.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/priority.hpp"
#include "security/caller_identity.hpp"

namespace rtpm::rpc {
namespace {

// Whether the interface's text has this method as one that gives no stream (hp-12.1).
bool gives_no_stream(const InterfaceDescriptor& interface, std::uint16_t method) noexcept {
  constexpr std::string_view kBegin = "\nmethod ";
  char word[16];
  kBegin.copy(word, kBegin.size());
  char* const end = std::to_chars(word + kBegin.size(), std::end(word), method).ptr;
  *end = ' ';
  const std::string_view text = interface.text;
  const std::size_t at = text.find(std::string_view(word, end + 1));
  if (at == std::string_view::npos) return false;
  return !text.substr(at + 1, text.find('\n', at + 1) - at - 1).ends_with(" stream");
}

}  // namespace

expected<Target, wire::Status> Dispatch::target_of(
    const wire::Request& request, const wire::ServerSessions* sessions) const noexcept {
  Target target{objects_.find(request.header.service)};
  if (target.object == nullptr) return unexpected{wire::Status::kNoSuchObject};
  if (rights_.is_asked()) {
    const auto origin = rights_.judge(request, *target.object, sessions);
    if (!origin) return unexpected{origin.error()};
    target.origin = *origin;
  }
  if (!admits(target.object->options, request.header.priority)) {
    return unexpected{wire::Status::kWrongBand};
  }
  return target;
}

Priority Dispatch::priority_of(const Object& object, const wire::Header& header) const noexcept {
  Priority priority = header.priority;
  if (object.options.model == PriorityModel::kServerDeclared) priority = object.options.priority;
  if (object.options.model == PriorityModel::kNone) priority = lane_priority_;
  return transform_ == nullptr ? priority : transform_(priority, object.path);
}

Ran Dispatch::run(const Target& target, const wire::Request& request, MutableBytes reply,
                  CallDeferral& deferral) const noexcept {
  const Ran ran = run_method(target, request, reply, deferral);
  if (target.origin != nullptr) {
    rights_.note_run(target, request,
                     deferral.is_taken() ? std::nullopt : std::optional(ran.result.status));
  }
  if (tap_.is_on()) [[unlikely]] {
    // The lane cannot end a deferred call before this, so the mark is set in time.
    if (PendingCall* const call = deferral.taken()) {
      call->tap_mark = tap_.on_begun(request);
    } else {
      tap_.on_whole(request, ran.result.status, reply.first(ran.result.reply_size));
    }
  }
  return ran;
}

Ran Dispatch::run_method(const Target& target, const wire::Request& request, MutableBytes reply,
                         CallDeferral& deferral) const noexcept {
  const wire::Header& header = request.header;
  std::optional<CallerIdentity> identity;
  if (target.origin != nullptr) identity.emplace(*rights_.control(), *target.origin);
  const CallContext context{priority_of(*target.object, header),
                            request.deadline,
                            request.received,
                            header.session,
                            header.trace_id,
                            &deferral,
                            {request.caller_host},
                            identity ? &*identity : nullptr};
  rt::adopt_priority(context.priority);
  const CurrentCall current(context, host_);
  const BusyMark busy(request.received);
  try {
    // hp-5.10-12
    if (request.wants_stream() &&
        gives_no_stream(target.object->servant->interface(), header.method)) [[unlikely]] {
      return {refuse(wire::Status::kBadRequest, "this method gives no stream", reply)};
    }
    DispatchResult result =
        target.object->servant->dispatch(header.method, request.payload, reply, context);
    if (result.status == wire::Status::kOverload && deferral.lacks_stream()) [[unlikely]] {
      result = refuse(wire::Status::kBadRequest, "this method gives a stream", reply);
    }
    if (result.status == wire::Status::kBadRequest && refusals_ != nullptr) [[unlikely]] {
      const std::string_view text(reinterpret_cast<const char*>(reply.data()), result.reply_size);
      refusals_->note(*target.object, request, result.status, text);
    }
    return {result};
  } catch (const std::exception& thrown) {
    return fail(target, request, reply, deferral, thrown.what());
  } catch (...) {
    return fail(target, request, reply, deferral, "something that is no std::exception");
  }
}

Ran Dispatch::fail(const Target& target, const wire::Request& request, MutableBytes reply,
                   const CallDeferral& deferral, std::string_view thrown) const noexcept {
  if (refusals_ != nullptr) {
    refusals_->note(*target.object, request, wire::Status::kServantFailed, thrown);
  }
  // Another thread may already write the answer.
  if (deferral.is_taken()) reply = {};
  return {refuse(wire::Status::kServantFailed, thrown, reply), /*has_thrown=*/true};
}

DispatchResult Dispatch::serve_session(const wire::Request& request,
                                       const wire::ServerSessions& sessions,
                                       MutableBytes reply) const noexcept {
  if (request.header.method == wire::kMethodPing) return {wire::Status::kOk, 0};  // hp-6.2-1
  std::optional<LaneRights::View> view;
  if (rights_.is_asked()) view.emplace(rights_.view_of(request, sessions));
  const ObjectView* const shown = view ? &*view : nullptr;
  switch (request.header.method) {
    case wire::kMethodBind: {
      const DispatchResult bound = objects_.bind(request.payload, reply, shown);
      if (view) rights_.note_bind(request, sessions, bound.status);
      return bound;
    }
    case wire::kMethodDescribe:
      return objects_.describe(request.payload, reply, shown);
    default:
      return {wire::Status::kNoSuchMethod, 0};
  }
}

DispatchResult Dispatch::run_nested(const LocalChannel& channel,
                                    LaneReport& report) const noexcept {
  const wire::Request request = request_of(channel);
  const auto target = target_of(request, nullptr);
  if (!target) return {target.error(), 0};
  const auto outer = rt::current_priority();
  // The thread could not return here to end the call.
  CallDeferral none;
  const Ran ran = run(*target, request, channel.reply(), none);
  if (outer) rt::adopt_priority(*outer);
  report.on_nested(ran.has_thrown);
  return ran.result;
}

wire::Request request_of(const LocalChannel& channel) noexcept {
  const LocalCallParameters& parameters = channel.parameters();
  wire::Request request;
  request.header.service = parameters.service;
  request.header.method = parameters.method;
  request.header.priority = parameters.priority;
  request.header.session = parameters.session;
  request.header.trace_id = parameters.trace_id;
  request.payload = channel.request();
  request.deadline = parameters.deadline;
  request.received = rt::now();
  request.caller_host = kThisHost.number;
  return request;
}

}  // namespace rtpm::rpc
