#include <cstring>
#include <utility>

#include "current_call.hpp"
#include "lane/lane.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/priority.hpp"
#include "server/policy.hpp"

// What a lane does with calls of the program it is in; see local.hpp.
namespace rtpm::rpc {
namespace {

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
  request.caller_host = kThisHost.ipv4;
  return request;
}

// Lets a method that runs on the caller's memory answer later, on that memory.
class LocalDeferral final : public Deferral {
 public:
  LocalDeferral(const std::shared_ptr<PendingPool>& pool, LocalChannel& channel,
                const wire::Request& request) noexcept
      : pool_(pool), channel_(channel), request_(request) {}

  DeferredReply defer() noexcept override {
    PendingCall* const call = pool_->take();
    if (call == nullptr) return {};
    is_taken_ = true;
    call->take_in(request_, channel_, /*is_elsewhere=*/true);
    call->request.payload = {};
    return reply_for(pool_, call);
  }
  ItemWriter stream() noexcept override { return {}; }
  [[nodiscard]] bool is_taken() const noexcept { return is_taken_; }

 private:
  const std::shared_ptr<PendingPool>& pool_;
  LocalChannel& channel_;
  const wire::Request& request_;
  bool is_taken_ = false;
};

// Of a call that runs inside of another one on the same thread, which could not come back to end
// it.
class NoDeferral final : public Deferral {
 public:
  DeferredReply defer() noexcept override { return {}; }
  ItemWriter stream() noexcept override { return {}; }
};

}  // namespace

bool Lane::serve_local() noexcept {
  const std::uint32_t refused_count = gate_->take_refused_count();
  LocalChannel* call = gate_->take_next();
  if (call == nullptr && refused_count == 0) return false;
  counters_.overload_count += refused_count;
  is_unpublished_ = true;
  if (call != nullptr) serve_local_call(*call);
  // One by turn, as of any source. A thread pool only puts them in order, which wants to know them
  // all.
  while (pool_ && (call = gate_->take_next()) != nullptr)
    serve_local_call(*call);
  publish();
  return true;
}

void Lane::serve_local_call(LocalChannel& channel) noexcept {
  const wire::Request request = request_of(channel);
  received_ = request.received;
  is_unpublished_ = true;
  const auto target = target_of(request);
  if (!target) return channel.finish(target.error(), 0);
  const Object& object = **target;
  if (pool_) {
    if (PendingCall* const call = take_pending()) {
      // Several threads at a time may run calls from places, which share the room for replies.
      call->take_in(request, channel, /*is_elsewhere=*/channel.is_place());
      if (find_place(*call, object)) return note_queued(request);
    }
    return channel.finish(refuse(), 0);
  }
  if (received_ >= request.deadline) {
    ++counters_.late_count;
    return channel.finish(wire::Status::kExpired, 0);
  }
  LocalDeferral deferral(pending_, channel, request);
  const DispatchResult result = run_now(object, request, channel.reply(), deferral);
  if (deferral.is_taken()) {
    ++counters_.deferred_count;
  } else {
    note_end(request, result.status, rt::now());
    channel.finish(result.status, result.reply_size);
  }
  end_cycle(rt::now());
}

// A local call whose method has ended it.
void Lane::serve_pending_local(PendingCall& call) noexcept {
  LocalChannel* const channel = call.local;
  // Without, its caller was told that the lane stops.
  if (channel != nullptr && channel->is_place()) {
    channel->finish(call.status, 0);
  } else if (channel != nullptr) {
    const bool fits = call.size <= channel->reply().size();
    if (fits && call.size > 0 && call.reply.data() != channel->reply().data()) {
      std::memcpy(channel->reply().data(), call.reply.data(), call.size);
    }
    channel->finish(fits ? call.status : wire::Status::kTooLarge, fits ? call.size : 0);
  }
  pending_->give_back(call);
}

DispatchResult Lane::run_nested(const LocalChannel& channel) noexcept {
  const wire::Request request = request_of(channel);
  const auto target = target_of(request);
  if (!target) return {target.error(), 0};
  const auto outer = rt::current_priority();
  NoDeferral no_deferral;
  bool has_thrown = false;
  const DispatchResult result =
      run_servant(**target, request, channel.reply(), no_deferral, has_thrown);
  if (outer) rt::adopt_priority(*outer);
  if (pool_) pool_->lock_as_follower();
  ++counters_.call_count;
  counters_.servant_failure_count += has_thrown ? 1 : 0;
  if (pool_) pool_->unlock();
  return result;
}

}  // namespace rtpm::rpc
