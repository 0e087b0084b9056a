#include "client/pipeline.hpp"

#include <algorithm>

#include "client/kept_copy.hpp"
#include "rtpm/base/assert.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/memory.hpp"

namespace rtpm::rpc {
namespace {

// The longest time that a call waits for others to go with, while its caller begins more or waits.
// If calls went at once whenever the caller waits, replies that come one by one would make the next
// calls go one by one for ever.
constexpr Duration kHoldTimeMax = std::chrono::microseconds{200};

// How many calls share a session. Over a connection, a reply that its caller does not take yet
// would block the others' replies, until the server gives the connection up (hp-16.4-2).
std::uint16_t calls_per_session(Transport transport) noexcept {
  return transport == Transport::kUdp ? wire::kCallWindow : 1;
}

}  // namespace

expected<void, CallError> PipelinePlace::begin(Binding::Impl& binding,
                                               const Binding::Impl::Plan& plan,
                                               const Binding::Impl::Ready& ready,
                                               ConstBytes request) noexcept {
  const auto kept = keep_copy(request_room_, request);
  if (!kept) return unexpected{CallError::kTooLarge};
  CallChannel& channel = *session_->channel;
  begun_ = rt::now();
  const auto call = channel.begin_held(ready.parameters, *kept, begun_);
  if (!call) return unexpected{call.error()};
  is_taken_ = true;
  is_leased_ = false;
  binding_ = &binding;
  plan_ = plan;
  ready_ = ready;
  call_ = *call;
  request_ = *kept;
  outcome_ = {.kind = CallOutcome::Kind::kGoing};
  session_->by_call[call_] = this;
  return {};
}

void PipelinePlace::end(const CallOutcome& outcome) noexcept {
  session_->by_call[call_] = nullptr;
  outcome_ = outcome;
  if (outcome.kind != CallOutcome::Kind::kReply) return;
  // The payload is in the channel's memory, which the next frame overwrites.
  if (const auto reply = keep_copy(reply_room_, outcome.payload)) {
    outcome_.payload = *reply;
  } else {
    outcome_ = {.error = CallError::kTooLarge};
  }
}

bool PipelinePlace::wait(MonotonicTime until) noexcept {
  if (!is_going()) return true;
  session_->take_buffered();
  if (!is_going()) return true;
  if (session_->has_held() && begun_ >= session_->held_since) session_->channel->flush();
  Pipeline::Impl& pipeline = session_->pipeline;
  for (MonotonicTime now = rt::now(); is_going(); now = rt::now()) {
    const MonotonicTime next = pipeline.flush_due(now);
    if (!session_->channel->has_session()) {
      // The flush lost it.
      session_->end_all({.error = CallError::kDisconnected});
      break;
    }
    const CallOutcome outcome = session_->channel->finish(std::min(until, next), now);
    session_->settle(outcome);
    if (outcome.kind == CallOutcome::Kind::kGoing && rt::now() >= until) return false;
  }
  return true;
}

expected<ReplyLease, CallError> PipelinePlace::take() noexcept {
  if (outcome_.kind == CallOutcome::Kind::kReply) {
    if (outcome_.status != wire::Status::kOk)
      return unexpected{refused(outcome_.status, outcome_.payload)};
    is_leased_ = true;
    return expected<ReplyLease, CallError>(std::in_place, outcome_.payload, *this);
  }
  return binding_->call_again(outcome_, ready_, plan_, begun_, request_);
}

void PipelinePlace::cancel() noexcept {
  if (!is_going()) return;
  // The server is to hear of the call first.
  session_->channel->flush();
  session_->channel->cancel(call_);
  end({.kind = CallOutcome::Kind::kFailed, .error = CallError::kCancelled});
}

void PipelinePlace::drop() noexcept {
  if (!is_leased_) is_taken_ = false;
}

void PipelinePlace::release() noexcept {
  is_taken_ = is_leased_ = false;
}

PipelinePlace* PipelineSession::free_place() noexcept {
  const auto found = std::ranges::find_if(places, &PipelinePlace::is_free);
  return found == places.end() ? nullptr : &*found;
}

bool PipelineSession::is_idle() const noexcept {
  return std::ranges::none_of(places, &PipelinePlace::is_going);
}

bool PipelineSession::is_free() const noexcept {
  return std::ranges::all_of(places, &PipelinePlace::is_free);
}

void PipelineSession::note_held(bool is_first, MonotonicTime begun) noexcept {
  if (is_first) {
    held_since = begun;
    held_count = 0;
  }
  // Not when the last place is taken: then a call would go alone wherever one was freed.
  if (++held_count == channel->call_count_max() || begun - held_since > kHoldTimeMax)
    channel->flush();
}

void PipelineSession::take_buffered() noexcept {
  while (channel->has_buffered() && !is_idle())
    settle(channel->finish(MonotonicTime{}, rt::now()));
}

void PipelineSession::settle(const CallOutcome& outcome) noexcept {
  const bool is_of_one = outcome.kind == CallOutcome::Kind::kReply || channel->has_session();
  if (is_of_one && outcome.kind != CallOutcome::Kind::kGoing) {
    PipelinePlace* const place = by_call[outcome.call];
    RTPM_ASSERT(place != nullptr, "a channel of a pipeline has its calls only");
    place->end(outcome);
  }
  if (!channel->has_session()) end_all(outcome);
}

void PipelineSession::end_all(const CallOutcome& outcome) noexcept {
  const bool says_why =
      outcome.kind == CallOutcome::Kind::kLost || outcome.kind == CallOutcome::Kind::kFailed;
  for (PipelinePlace& place : places) {
    if (!place.is_going()) continue;
    place.end(says_why ? outcome : CallOutcome{.error = CallError::kDisconnected});
  }
}

Pipeline::Impl::~Impl() {
  RTPM_ASSERT(open_count() == 0, "a pipeline outlives its calls and their replies");
}

// Whether a call can begin there now.
bool Pipeline::Impl::can_take(PipelineSession& session, const Endpoint& endpoint, Priority priority,
                              std::uint64_t server_epoch) noexcept {
  CallChannel& channel = *session.channel;
  if (&session.endpoint != &endpoint || session.free_place() == nullptr) return false;
  if (!channel.has_session()) {
    // A flush may have lost it.
    session.end_all({.error = CallError::kDisconnected});
    return channel.is_new() || channel.serves(priority);
  }
  if (!channel.serves(priority)) return false;
  return session.is_idle() || (channel.has_free_call() && channel.server_epoch() == server_epoch);
}

expected<PipelineSession*, CallError> Pipeline::Impl::session_for(
    Endpoint& endpoint, Priority priority, std::uint64_t server_epoch) noexcept {
  for (std::size_t i = 0; i < sessions_.size(); ++i) {
    const std::size_t index = (last_ + i) % sessions_.size();
    if (!can_take(*sessions_[index], endpoint, priority, server_epoch)) continue;
    last_ = index;
    return sessions_[index].get();
  }
  const auto channel = endpoint.take(priority, calls_per_session(endpoint.address().transport));
  if (!channel) return unexpected{channel.error()};
  const rt::AllowAllocationScope is_allowed;
  // Frees the sessions with servers to which no binding leads any more.
  std::erase_if(sessions_, [](const auto& session) {
    return session->endpoint.user_count() == 0 && session->is_free();
  });
  last_ = sessions_.size();
  sessions_.push_back(std::make_unique<PipelineSession>(*this, endpoint, *channel));
  for (PipelinePlace& place : sessions_.back()->places)
    place.session_ = sessions_.back().get();
  return sessions_.back().get();
}

expected<PipelinePlace*, CallError> Pipeline::Impl::begin(Binding::Impl& binding,
                                                          const Binding::Impl::Plan& plan,
                                                          ConstBytes request) noexcept {
  for (int round = 0; round < Binding::Impl::kRoundCountMax; ++round) {
    const Binding::Impl::Pin pin(binding);
    const Bound bound = binding.remembered();
    const Priority priority = binding.priority_of(plan, bound);
    auto session = session_for(bound.destination->endpoint, priority, bound.server_epoch);
    if (!session) return unexpected{session.error()};
    CallChannel& channel = *(*session)->channel;
    Binding::Impl::Ready ready;
    if (auto made = binding.make_ready_on(channel, bound, priority, plan, ready); !made) {
      return unexpected{made.error()};
    }
    if (ready.channel == nullptr) continue;
    if (!channel.has_free_call()) return unexpected{CallError::kNoChannel};
    PipelinePlace* const place = (*session)->free_place();
    const bool is_first = !(*session)->has_held();
    if (auto begun = place->begin(binding, plan, ready, request); !begun) {
      return unexpected{begun.error()};
    }
    (*session)->note_held(is_first, plan.begun);
    return place;
  }
  return unexpected{CallError::kPeerRestarted};
}

void Pipeline::Impl::flush() noexcept {
  for (const auto& session : sessions_)
    session->channel->flush();
}

MonotonicTime Pipeline::Impl::flush_due(MonotonicTime now) noexcept {
  MonotonicTime next = kNever;
  for (const auto& session : sessions_) {
    if (!session->has_held()) continue;
    const MonotonicTime end = session->held_since + kHoldTimeMax;
    if (end <= now) {
      session->channel->flush();
    } else {
      next = std::min(next, end);
    }
  }
  return next;
}

std::size_t Pipeline::Impl::open_count() const noexcept {
  std::size_t count = 0;
  for (const auto& session : sessions_) {
    count += static_cast<std::size_t>(std::ranges::count_if(
        session->places, [](const PipelinePlace& place) { return !place.is_free(); }));
  }
  return count;
}

Pipeline::Pipeline() : impl_(std::make_unique<Impl>()) {}
Pipeline::~Pipeline() = default;

void Pipeline::flush() noexcept {
  impl_->flush();
}

std::size_t Pipeline::open_count() const noexcept {
  return impl_->open_count();
}

}  // namespace rtpm::rpc
