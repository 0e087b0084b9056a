#include <algorithm>
#include <array>
#include <cstring>
#include <exception>
#include <utility>

#include "current_call.hpp"
#include "lane/lane.hpp"
#include "rtpm/base/assert.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/priority.hpp"
#include "server/lane_table_owner.hpp"
#include "server/policy.hpp"

// What a lane does with a call: at once, or later.
namespace rtpm::rpc {
namespace {

// A place for a call that may outlast its frame; null if there is none.
PendingCall* keep(PendingPool& pool, wire::ServerSessions& sessions,
                  const wire::Request& request) noexcept {
  PendingCall* const call = pool.take();
  if (call == nullptr) return nullptr;
  call->take_in(request, sessions);
  // It views the frame, or a room, that is another's when the method has returned.
  call->request.payload = {};
  sessions.set_tag(request, pool.tag_of(*call));
  return call;
}

// Gives the method that runs the means not to answer yet.
class LaneDeferral final : public Deferral {
 public:
  /// `kept`: the place that the call has already, if it has one.
  LaneDeferral(const std::shared_ptr<PendingPool>& pool, wire::ServerSessions& sessions,
               const wire::Request& request, PendingCall* kept = nullptr) noexcept
      : pool_(pool), sessions_(sessions), request_(request), kept_(kept) {}

  DeferredReply defer() noexcept override {
    if (PendingCall* const call = take()) return reply_for(pool_, call);
    return {};
  }
  ItemWriter stream() noexcept override {
    if (sessions_.item_size_max(request_) == 0) return {};
    if (PendingCall* const call = take()) return writer_for(pool_, call);
    return {};
  }
  [[nodiscard]] bool is_taken() const noexcept { return is_taken_; }

 private:
  [[nodiscard]] PendingCall* take() noexcept {
    RTPM_ASSERT(!is_taken_, "a call is deferred once");
    PendingCall* const call = kept_ != nullptr ? kept_ : keep(*pool_, sessions_, request_);
    is_taken_ = call != nullptr;
    return call;
  }

  const std::shared_ptr<PendingPool>& pool_;
  wire::ServerSessions& sessions_;
  const wire::Request& request_;
  PendingCall* kept_;
  bool is_taken_ = false;
};

}  // namespace

ConstBytes Lane::run_request(wire::ServerSessions& sessions,
                             const wire::Request& request) noexcept {
  if (pool_) {
    if (const auto object = target_of(request)) return queue_request(sessions, request, **object);
  }
  if (request.wants_receipt()) return run_accepted(sessions, request);
  if (sessions.is_short_of_rooms(request, request.received)) {
    return run_without_room(sessions, request);
  }
  const MutableBytes reply = sessions.reply_buffer(request, request.received);
  LaneDeferral deferral(pending_, sessions, request);
  const DispatchResult result = dispatch(request, reply, deferral);
  if (deferral.is_taken()) {
    ++counters_.deferred_count;
    return {};
  }
  RTPM_ASSERT(result.reply_size <= reply.size(), "a reply stays within its buffer");
  completed_ = rt::now();
  note_end(request, result.status, completed_);
  return sessions.complete(request, result.status, result.reply_size, completed_);
}

// Runs a call whose reply, if it is a large one, will have to wait for a room. Where it could not
// wait either, the call is refused before it runs: afterwards it would be too late to say so.
ConstBytes Lane::run_without_room(wire::ServerSessions& sessions,
                                  const wire::Request& request) noexcept {
  PendingCall* const call = keep(*pending_, sessions, request);
  if (call == nullptr) {
    ++counters_.overload_count;
    return sessions.complete(request, wire::Status::kOverload, 0, request.received);
  }
  const std::size_t size_max = sessions.reply_size_max(request);
  call->reply = call->reply_room.first(std::min(call->reply_room.size(), size_max));
  LaneDeferral deferral(pending_, sessions, request, call);
  const DispatchResult result = dispatch(request, call->reply, deferral);
  completed_ = rt::now();
  if (deferral.is_taken()) {
    ++counters_.deferred_count;
    return {};
  }
  RTPM_ASSERT(result.reply_size <= call->reply.size(), "a reply stays within its buffer");
  call->status = result.status;
  call->size = result.reply_size;
  call->is_ended.store(true, std::memory_order_release);
  serve_pending_call(*call);
  return {};
}

// hp-5.8-3: the caller goes on as soon as it is clear that its call will run.
ConstBytes Lane::run_accepted(wire::ServerSessions& sessions,
                              const wire::Request& request) noexcept {
  const auto target = target_of(request);
  const wire::Status status = target ? wire::Status::kOk : target.error();
  const auto peer = sessions.peer_of(request);
  RTPM_ASSERT(peer.has_value(), "a request that just came has a session");
  send(sessions, *peer, sessions.accept(request, status, rt::now()));
  const MutableBytes reply = sessions.reply_buffer(request, request.received);
  LaneDeferral deferral(pending_, sessions, request);
  DispatchResult result;
  if (target) result = run_now(**target, request, reply, deferral);
  if (deferral.is_taken()) {
    ++counters_.deferred_count;
    return {};
  }
  completed_ = rt::now();
  note_end(request, result.status, completed_);
  return sessions.complete(request, result.status, 0, completed_);
}

// Counts a call that was not answered in time. A stream's deadline is until when its caller is to
// be heard of, which ends with its first sign of life.
void Lane::note_end(const wire::Request& request, wire::Status status, MonotonicTime now) noexcept {
  const bool has_deadline = !request.wants_stream() || status == wire::Status::kExpired;
  if (has_deadline && now >= request.deadline) ++counters_.late_count;
}

// The object on which a method would run, or why none would.
expected<const Object*, wire::Status> Lane::target_of(const wire::Request& request) const noexcept {
  const Object* const object = objects_.find(request.header.service);
  if (object == nullptr) return unexpected{wire::Status::kNoSuchObject};
  if (!admits(object->options, request.header.priority)) {
    return unexpected{wire::Status::kWrongBand};
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
  if (is_periodic_) predictor_.on_arrival(request.header.session, request.received);
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
                            &deferral,
                            {request.caller_host}};
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
  Connection* const connection = connection_of(peer);
  if (connection == nullptr) return;
  for (; !frame.empty(); frame = sessions.next_frame(rt::now())) {
    if (connection->stream->send(frame, transport::kAlready)) continue;
    ++counters_.send_failure_count;
    retire(static_cast<Source>(connection - connections_.data()));
    return;
  }
}

// Null once it has ended.
Lane::Connection* Lane::connection_of(const wire::PeerAddress& peer) noexcept {
  Connection& connection = connections_[peer.port & kIndexMask];
  return connection.stream && connection.peer == peer ? &connection : nullptr;
}

// What a frame may have changed for calls that were deferred.
void Lane::after_frame(std::uint32_t credit_tag) noexcept {
  if (pending_->open_count() == 0) return;
  tell_cancelled(CallEnding::kLeft);
  if (waiting_reply_count_ > 0 && has_freed_room()) serve_waiting_replies();
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
  if (waiting_reply_count_ > 0 && rt::now() >= waiting_reply_due_) serve_waiting_replies();
  return pending_->has_ready() && serve_pending();
}

bool Lane::serve_pending() noexcept {
  // Callers have to wait for as many.
  constexpr int kCallsPerTurn = 32;
  bool has_some = false;
  for (int i = 0; i < kCallsPerTurn; ++i) {
    PendingCall* const call = pending_->take_ready();
    if (call == nullptr) break;
    has_some = true;
    serve_pending_call(*call);
  }
  publish();
  return has_some;
}

void Lane::serve_pending_call(PendingCall& call) noexcept {
  // Whoever ended it may have been slower to tell so than the lane to see it.
  if (!call.is_taken) return;
  const bool is_ended = call.is_ended.load(std::memory_order_acquire);
  // The method may still read its request. Where the connection ended meanwhile, the call may have
  // been given back.
  if (!send_items(call) || !call.is_taken || !is_ended || call.is_running) return;
  const MonotonicTime now = rt::now();
  if (call.sessions != nullptr && must_wait_for_room(call, now)) return;
  if (call.is_awaited.load(std::memory_order_relaxed)) note_end(call.request, call.status, now);
  if (call.sessions == nullptr) return serve_pending_local(call);
  wire::ServerSessions& sessions = *call.sessions;
  const auto peer = sessions.peer_of(call.request);
  const MutableBytes room = sessions.reply_buffer(call.request, now);
  std::uint32_t size = call.size;
  if (size > sessions.reply_size_max(call.request)) {
    size = 0;
    call.status = wire::Status::kTooLarge;
  }
  // It waited for a room until nobody waited for it.
  const bool is_given_up = size > room.size();
  if (is_given_up) {
    size = 0;
    call.status = wire::Status::kCancelled;
  }
  if (size > 0) std::memcpy(room.data(), call.reply.data(), size);
  const wire::Request request = call.request;
  const ConstBytes frame = sessions.complete(request, call.status, size, now);
  pending_->give_back(call);
  if (peer && !is_given_up) send(sessions, *peer, frame);
}

// Whether a call that ended with a large reply has to wait until there is a room for it: it ran, so
// that nothing but its reply is an answer, for as long as its caller waits.
bool Lane::must_wait_for_room(PendingCall& call, MonotonicTime now) noexcept {
  wire::ServerSessions& sessions = *call.sessions;
  const bool may_wait = call.is_awaited.load(std::memory_order_relaxed) &&
                        call.request.deadline > now &&
                        call.size <= sessions.reply_size_max(call.request);
  const bool waits = may_wait && call.size > sessions.reply_buffer(call.request, now).size();
  const bool has_waited = std::exchange(call.waits_for_room, waits);
  waiting_reply_count_ = waiting_reply_count_ - (has_waited ? 1 : 0) + (waits ? 1 : 0);
  // A time that nobody looks at any more would keep the lane from sleeping.
  if (waiting_reply_count_ == 0) waiting_reply_due_ = kNever;
  if (waits) {
    waiting_reply_due_ =
        std::min({waiting_reply_due_, call.request.deadline, sessions.next_room_time(now)});
  }
  return waits;
}

// Sends the items that are there, as far as their caller takes them, its connection has room, and
// the turn has time; false if some are left.
bool Lane::send_items(PendingCall& call) noexcept {
  // SYNC POINT pending-items
  const std::uint32_t written = call.written_count.load(std::memory_order_acquire);
  std::uint32_t sent = call.sent_count.load(std::memory_order_relaxed);
  if (sent == written) return true;
  call.is_blocked = false;
  const auto peer = call.sessions->peer_of(call.request);
  Connection* connection = nullptr;
  if (peer && call.sessions != &datagram_sessions_) connection = connection_of(*peer);
  while (sent != written && call.is_taken) {
    if (!call.sessions->peer_of(call.request) || !call.is_awaited.load(std::memory_order_relaxed)) {
      sent = written;
    } else if (!send_item_frame(call, sent, connection)) {
      break;
    } else if (call.is_taken && !call.sessions->is_item_midway(call.request)) {
      ++sent;
    }
  }
  flush_answers();
  if (!call.is_taken) return true;
  call.sent_count.store(sent, std::memory_order_release);
  return sent == written;
}

bool Lane::has_freed_room() noexcept {
  bool has_freed = false;
  for (wire::ServerSessions* sessions :
       {&datagram_sessions_, &stream_sessions_, &memory_sessions_}) {
    has_freed |= sessions->has_freed_room();
  }
  return has_freed;
}

// Large replies for which there was no room: there may be one now.
void Lane::serve_waiting_replies() noexcept {
  waiting_reply_due_ = kNever;
  pending_->for_each_open([&](PendingCall& call) {
    if (call.waits_for_room) serve_pending_call(call);
  });
}

// Sends the next frame of an item; false if that is not the time.
bool Lane::send_item_frame(PendingCall& call, std::uint32_t number,
                           Connection* connection) noexcept {
  if (item_bytes_left_ == 0) {
    if (!std::exchange(call.is_in_backlog, true)) backlog_.push_back(&call);
    // The thread that sends it may sleep while another ends a call.
    bell_->wake();
    return false;
  }
  const ConstBytes item = call.item(number);
  const std::size_t size_max =
      wire::kHeaderSize + std::min<std::size_t>(item.size(), call.item_frame_size_max);
  if (connection != nullptr && !connection->stream->has_spare_room(size_max)) {
    // hp-16.4-2: a reader that is slow is no reason to end the connection.
    constexpr Duration kRetryInterval = std::chrono::milliseconds{1};
    call.is_blocked = true;
    if (retry_time_ == kNever) {
      retry_time_ = rt::now() + kRetryInterval;
      bell_->wake();
    }
    return false;
  }
  const ConstBytes frame = call.sessions->push_item(call.request, item, rt::now());
  if (frame.empty()) return false;
  item_bytes_left_ -= std::min(item_bytes_left_, frame.size());
  is_unpublished_ = true;
  if (connection == nullptr) {
    answer(*call.sessions->peer_of(call.request), frame, /*has_more=*/true);
  } else if (!connection->stream->send(frame, transport::kAlready)) {
    ++counters_.send_failure_count;
    retire(static_cast<Source>(connection - connections_.data()));
  }
  return true;
}

// Goes on with the streams for which an earlier turn had no time; true if there were some. One that
// is not done stands behind the others.
bool Lane::send_backlog() noexcept {
  // A small call that comes now waits as long as it takes to send this.
  constexpr std::size_t kItemBytesPerTurn = std::size_t{32} * 1024;
  item_bytes_left_ = kItemBytesPerTurn;
  const std::size_t count = backlog_.size();
  std::size_t served_count = 0;
  for (; served_count < count && item_bytes_left_ > 0; ++served_count) {
    PendingCall& call = *backlog_[served_count];
    call.is_in_backlog = false;
    serve_pending_call(call);
  }
  backlog_.erase(backlog_.begin(), backlog_.begin() + static_cast<std::ptrdiff_t>(served_count));
  return count > 0;
}

// Tries streams again whose connections had no room.
void Lane::retry_blocked(MonotonicTime now) noexcept {
  if (now < retry_time_) return;
  retry_time_ = kNever;
  pending_->for_each_open([&](PendingCall& call) {
    if (call.is_blocked) serve_pending_call(call);
  });
}

// Streams of which nobody was heard for too long end by themselves.
void Lane::look_at_time() noexcept {
  const MonotonicTime now = rt::now();
  for (wire::ServerSessions* sessions :
       {&datagram_sessions_, &stream_sessions_, &memory_sessions_}) {
    if (sessions->next_time() > now) continue;
    tell_cancelled(CallEnding::kLeft);
    const std::uint64_t expired_before = sessions->counters().expired_count;
    sessions->on_time(now);
    silent_stream_count_ += sessions->counters().expired_count - expired_before;
    tell_cancelled(CallEnding::kSilent);
  }
  if (now >= waiting_reply_due_) serve_waiting_replies();
  retry_blocked(now);
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
