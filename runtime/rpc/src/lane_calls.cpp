#include <algorithm>
#include <array>
#include <cstring>
#include <exception>
#include <utility>

#include "current_call.hpp"
#include "lane.hpp"
#include "lane_table_owner.hpp"
#include "policy.hpp"
#include "rtpm/base/assert.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/priority.hpp"

// What a lane does with a call: at once, or later.
namespace rtpm::rpc {
namespace {

// Gives the method that runs the means not to answer yet.
class LaneDeferral final : public Deferral {
 public:
  LaneDeferral(const std::shared_ptr<PendingPool>& pool, wire::ServerSessions& sessions,
               const wire::Request& request) noexcept
      : pool_(pool), sessions_(sessions), request_(request) {}

  DeferredReply defer() noexcept override {
    if (PendingCall* const call = take()) return reply_for(pool_, call);
    return {};
  }
  ItemWriter stream() noexcept override {
    const std::size_t room = sessions_.item_buffer(request_).size();
    if (room == 0) return {};
    PendingCall* const call = take();
    if (call == nullptr) return {};
    call->item_size_max = static_cast<std::uint32_t>(room);
    return writer_for(pool_, call);
  }
  [[nodiscard]] bool is_taken() const noexcept { return is_taken_; }

 private:
  [[nodiscard]] PendingCall* take() noexcept {
    RTPM_ASSERT(!is_taken_, "a call is deferred once");
    PendingCall* const call = pool_->take();
    if (call == nullptr) return nullptr;
    is_taken_ = true;
    call->take_in(request_, sessions_);
    // It views the frame, or a room, that is another's when the method has returned.
    call->request.payload = {};
    sessions_.set_tag(request_, pool_->tag_of(*call));
    return call;
  }

  const std::shared_ptr<PendingPool>& pool_;
  wire::ServerSessions& sessions_;
  const wire::Request& request_;
  bool is_taken_ = false;
};

}  // namespace

ConstBytes Lane::run_request(wire::ServerSessions& sessions,
                             const wire::Request& request) noexcept {
  if (crew_) {
    if (const auto object = target_of(request)) return queue_request(sessions, request, **object);
  }
  if (request.wants_receipt()) return run_accepted(sessions, request);
  const MutableBytes reply = sessions.reply_buffer(request);
  LaneDeferral deferral(pending_, sessions, request);
  const DispatchResult result = dispatch(request, reply, deferral);
  if (deferral.is_taken()) {
    ++counters_.deferred_count;
    return {};
  }
  RTPM_ASSERT(result.reply_size <= reply.size(), "a reply stays within its buffer");
  completed_ = rt::now();
  return sessions.complete(request, result.status, result.reply_size, completed_);
}

// hp-5.8-3: the caller goes on as soon as it is clear that its call will run.
ConstBytes Lane::run_accepted(wire::ServerSessions& sessions,
                              const wire::Request& request) noexcept {
  const auto target = target_of(request);
  const wire::Status status = target ? wire::Status::kOk : target.error();
  const auto peer = sessions.peer_of(request);
  RTPM_ASSERT(peer.has_value(), "a request that just came has a session");
  send(sessions, *peer, sessions.accept(request, status, rt::now()));
  const MutableBytes reply = sessions.reply_buffer(request);
  LaneDeferral deferral(pending_, sessions, request);
  DispatchResult result;
  if (target) result = run_now(**target, request, reply, deferral);
  if (deferral.is_taken()) {
    ++counters_.deferred_count;
    return {};
  }
  completed_ = rt::now();
  return sessions.complete(request, result.status, 0, completed_);
}

// The object on which a method would run, or why none would.
expected<const Object*, wire::Status> Lane::target_of(const wire::Request& request) const noexcept {
  const Object* const object = objects_.find(request.header.service);
  if (object == nullptr) return unexpected{wire::Status::kNoSuchObject};
  if (!admits(object->options, request.header.priority)) {
    return unexpected{wire::Status::kPriorityNotAllowed};
  }
  return object;
}

DispatchResult Lane::dispatch(const wire::Request& request, MutableBytes reply,
                              Deferral& deferral) noexcept {
  const wire::Header& header = request.header;
  if (header.service == wire::kSessionService) {
    if (header.method == wire::kMethodBind) return objects_.bind(request.payload, reply);
    // hp-6.2-1
    if (header.method == wire::kMethodPing) return {wire::Status::kOk, 0};
    if (header.method == wire::kMethodDescribe) return objects_.describe(request.payload, reply);
    return {wire::Status::kNoSuchMethod, 0};
  }
  const auto object = target_of(request);
  if (!object) return {object.error(), 0};
  return run_now(**object, request, reply, deferral);
}

// Runs a method on the lane's own thread.
DispatchResult Lane::run_now(const Object& object, const wire::Request& request, MutableBytes reply,
                             Deferral& deferral) noexcept {
  ++counters_.call_count;
  if (is_periodic_) foresight_.on_arrival(request.header.session, request.received);
  bool has_thrown = false;
  const DispatchResult result = run_servant(object, request, reply, deferral, has_thrown);
  if (has_thrown) ++counters_.servant_failure_count;
  if (result.status == wire::Status::kBadRequest) ++counters_.bad_request_count;
  // The lane waits on at the request's level, unless that is below its own: so a caller that keeps
  // its priority costs no syscall from call to call.
  if (rt::current_priority() < config_.priority) rt::adopt_priority(config_.priority);
  return result;
}

Priority Lane::priority_of(const Object& object, const wire::Header& header) const noexcept {
  Priority priority = header.priority;
  if (object.options.model == PriorityModel::kServerDeclared) priority = object.options.priority;
  if (object.options.model == PriorityModel::kNone) priority = config_.priority;
  if (inbound_priority_ != nullptr) priority = inbound_priority_(priority, object.path);
  return priority;
}

// Runs the method at the request's own level.
DispatchResult Lane::run_servant(const Object& object, const wire::Request& request,
                                 MutableBytes reply, Deferral& deferral,
                                 bool& has_thrown) noexcept {
  const wire::Header& header = request.header;
  const CallContext context{priority_of(object, header),
                            request.deadline,
                            request.received,
                            header.session,
                            header.trace_id,
                            &deferral};
  rt::adopt_priority(context.priority);
  const CurrentCall current(context, *this);
  const BusyMark busy(request.received);
  try {
    return object.servant->dispatch(header.method, request.payload, reply, context);
  } catch (...) {
    has_thrown = true;
    return {wire::Status::kServantFailed, 0};
  }
}

// Sends a frame that no request at hand asked for, and what belongs behind it.
void Lane::send(wire::ServerSessions& sessions, const wire::PeerAddress& peer,
                ConstBytes frame) noexcept {
  if (frame.empty()) return;
  is_unpublished_ = true;
  if (&sessions == &datagram_sessions_) return answer(peer, frame, /*has_more=*/false);
  const auto connection = std::ranges::find_if(
      connections_, [&](const Connection& each) { return each.stream && each.peer == peer; });
  if (connection == connections_.end()) return;
  for (; !frame.empty(); frame = sessions.next_frame(rt::now())) {
    if (connection->stream->send(frame, transport::Poller::kAlready)) continue;
    ++counters_.send_failure_count;
    retire(static_cast<Source>(connection - connections_.begin()));
    return;
  }
}

// What a frame may have changed for calls that were deferred.
void Lane::after_frame(std::uint32_t credit_tag) noexcept {
  if (pending_->open_count() == 0) return;
  tell_cancelled(CallEnding::kLeft);
  if (credit_tag != 0) serve_pending_call(pending_->tagged(credit_tag));
}

// Calls that their callers cancelled, or whose sessions ended: whoever has them may stop.
void Lane::tell_cancelled(CallEnding why) noexcept {
  for (wire::ServerSessions* sessions :
       {&datagram_sessions_, &stream_sessions_, &memory_sessions_}) {
    while (const std::uint32_t tag = sessions->next_cancelled()) {
      PendingCall& call = pending_->tagged(tag);
      call.ending.store(why, std::memory_order_relaxed);
      call.is_awaited.store(false, std::memory_order_release);
      serve_pending_call(call);
    }
  }
}

bool Lane::look_at_pending() noexcept {
  tell_cancelled(CallEnding::kLeft);
  return pending_->has_ready() && serve_pending();
}

bool Lane::serve_pending() noexcept {
  const bool has_some = pending_->take_ready([&](PendingCall& call) { serve_pending_call(call); });
  publish();
  return has_some;
}

void Lane::serve_pending_call(PendingCall& call) noexcept {
  // Whoever ended it may have been slower to tell so than the lane to see it.
  if (!call.is_taken) return;
  const bool is_ended = call.is_ended.load(std::memory_order_acquire);
  // The method may still read its request.
  if (!send_items(call) || !is_ended || call.is_running) return;
  if (call.sessions == nullptr) return serve_pending_local(call);
  wire::ServerSessions& sessions = *call.sessions;
  const auto peer = sessions.peer_of(call.request);
  const MutableBytes room = sessions.reply_buffer(call.request);
  std::uint32_t size = call.size;
  if (size > room.size()) {
    size = 0;
    call.status = wire::Status::kTooLarge;
  }
  if (size > 0) std::memcpy(room.data(), call.reply.data(), size);
  const wire::Request request = call.request;
  const ConstBytes frame = sessions.complete(request, call.status, size, rt::now());
  pending_->give_back(call);
  if (peer) send(sessions, *peer, frame);
}

// Sends the items that are there, as far as their caller takes them; false if some are left.
bool Lane::send_items(PendingCall& call) noexcept {
  // SYNC POINT pending-items
  const std::uint32_t written = call.written_count.load(std::memory_order_acquire);
  std::uint32_t sent = call.sent_count.load(std::memory_order_relaxed);
  while (sent != written) {
    const auto peer = call.sessions->peer_of(call.request);
    if (!peer || !call.is_awaited.load(std::memory_order_relaxed)) {
      sent = written;
      break;
    }
    const MutableBytes room = call.sessions->item_buffer(call.request);
    if (room.empty()) break;
    const std::uint32_t place = sent % PendingCall::kItemCountMax;
    const std::uint32_t size = call.item_sizes[place];
    if (size > 0) {
      std::memcpy(room.data(),
                  call.items.bytes().data() + place * std::size_t{wire::kStreamFrameSizeMax}, size);
    }
    ++sent;
    send(*call.sessions, *peer, call.sessions->push_item(call.request, size, rt::now()));
  }
  call.sent_count.store(sent, std::memory_order_release);
  return sent == written;
}

// Streams of which nobody was heard for too long end by themselves.
void Lane::look_at_time() noexcept {
  const MonotonicTime now = rt::now();
  for (wire::ServerSessions* sessions :
       {&datagram_sessions_, &stream_sessions_, &memory_sessions_}) {
    if (sessions->next_time() > now) continue;
    tell_cancelled(CallEnding::kLeft);
    sessions->on_time(now);
    tell_cancelled(CallEnding::kSilent);
  }
}

// hp-4.5-2
void Lane::say_goodbye() noexcept {
  gate_->close();
  pending_->for_each_open([&](PendingCall& call) {
    call.ending.store(CallEnding::kStopping, std::memory_order_relaxed);
    call.is_awaited.store(false, std::memory_order_release);
    if (call.local != nullptr) {
      // One that still runs has its caller's memory, and is ended by its own thread.
      if (!call.is_running) std::exchange(call.local, nullptr)->finish(wire::Status::kStopping, 0);
      return;
    }
    const auto peer = call.sessions->peer_of(call.request);
    const ConstBytes frame =
        call.sessions->complete(call.request, wire::Status::kStopping, 0, rt::now());
    if (peer) send(*call.sessions, *peer, frame);
    // Its place stays taken: whoever has it may still write there.
  });
  for (wire::ServerSessions* sessions :
       {&datagram_sessions_, &stream_sessions_, &memory_sessions_}) {
    while (const auto close = sessions->close_next(rt::now())) {
      send(*sessions, close->peer, close->frame);
    }
  }
  publish();
}

}  // namespace rtpm::rpc
