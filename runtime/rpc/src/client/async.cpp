#include "rtpm/rpc/async.hpp"

#include "client/binding_impl.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/memory.hpp"

// The kinds of calls that a binding offers: call and wait, send, begin, stream.
namespace rtpm::rpc {

expected<ReplyLease, CallError> Binding::call(const MethodDescriptor& method, ConstBytes request,
                                              const CallOptions& options) noexcept {
  return impl_->call(impl_->plan(method, options), request);
}

expected<wire::PeerClock, CallError> Binding::ping(const CallOptions& options) noexcept {
  static constexpr MethodDescriptor kPing{wire::kMethodPing, "ping", 0, /*is_idempotent=*/true, {}};
  Impl::Plan plan = impl_->plan(kPing, options);
  plan.target = Impl::Target::kSession;
  const auto reply = impl_->call(plan, {});
  if (!reply) return unexpected{reply.error()};
  // A repeated ping gives no time, and it may be the channel's first call.
  constexpr wire::PeerClock kNotKnown{.uncertainty = Duration::max()};
  return reply->channel_->peer_clock(rt::now()).value_or(kNotKnown);
}

expected<void, CallError> Binding::send(const MethodDescriptor& method, ConstBytes request,
                                        wire::Delivery delivery,
                                        const CallOptions& options) noexcept {
  Impl::Plan plan = impl_->plan(method, options);
  plan.delivery = delivery;
  const auto reply = impl_->call(plan, request);
  if (!reply) return unexpected{reply.error()};
  return {};
}

expected<void, CallError> Binding::check_oneways() noexcept {
  {
    const Destinations::Pin pin(impl_->destinations());
    impl_->destinations().get().destination->endpoint.check_oneways(rt::now());
  }
  if (impl_->destinations().has_lost_oneways()) return unexpected{CallError::kMaybeLost};
  return {};
}

std::uint64_t Binding::lost_oneway_count() const noexcept {
  const Destinations::Pin pin(impl_->destinations());
  return impl_->destinations().get().destination->lost_oneway_count();
}

/// An asynchronous call, on its own channel.
struct PendingReply::State {
  State(Binding::Impl& binding_in, const Binding::Impl::Plan& plan_in,
        const Binding::Impl::Ready& ready_in) noexcept
      : binding(binding_in), plan(plan_in), ready(ready_in), channel(ready_in.channel) {}

  [[nodiscard]] bool wait(MonotonicTime until) noexcept {
    if (outcome.kind == CallOutcome::Kind::kGoing) outcome = channel->finish(until, rt::now());
    return outcome.kind != CallOutcome::Kind::kGoing;
  }
  [[nodiscard]] expected<ReplyLease, CallError> take() noexcept {
    if (outcome.kind == CallOutcome::Kind::kReply) {
      if (outcome.status != wire::Status::kOk)
        return unexpected{refused(outcome.status, outcome.payload)};
      return ReplyLease(outcome.payload, channel.keep());
    }
    // Until then this call's channel keeps the request.
    return binding.call_again(outcome, ready, plan, channel->call_begun(), request);
  }
  void cancel() noexcept {
    if (outcome.kind != CallOutcome::Kind::kGoing) return;
    channel->cancel();
    outcome = {.kind = CallOutcome::Kind::kFailed, .error = CallError::kCancelled};
  }

  Binding::Impl& binding;
  Binding::Impl::Plan plan;
  Binding::Impl::Ready ready;
  TakenChannel channel;
  ConstBytes request{};
  /// Not kGoing before the call is sent, so that there is nothing to cancel.
  CallOutcome outcome{};
};

PendingReply::PendingReply() noexcept = default;
PendingReply::PendingReply(PendingReply&& other) noexcept = default;
PendingReply::PendingReply(std::unique_ptr<State> state) noexcept : state_(std::move(state)) {}

PendingReply& PendingReply::operator=(PendingReply&& other) noexcept {
  std::swap(state_, other.state_);
  return *this;
}

PendingReply::~PendingReply() {
  cancel();
  // Freeing the state is allowed here, as its allocation was in begin().
  const rt::AllowAllocationScope is_allowed;
  state_.reset();
}

expected<PendingReply, CallError> Binding::begin(const MethodDescriptor& method, ConstBytes request,
                                                 const CallOptions& options) {
  const Impl::Plan plan = impl_->plan(method, options);
  Impl::Ready ready;
  if (auto made = impl_->make_ready(plan, plan.begun, ready); !made) {
    return unexpected{made.error()};
  }
  PendingReply pending(std::make_unique<PendingReply::State>(*impl_, plan, ready));
  PendingReply::State& state = *pending.state_;
  const auto kept = state.channel->keep(request);
  if (!kept) return unexpected{CallError::kTooLarge};
  state.request = *kept;
  if (auto begun = state.channel->begin(ready.parameters, state.request, rt::now()); !begun) {
    return unexpected{begun.error()};
  }
  state.outcome = {.kind = CallOutcome::Kind::kGoing};
  return pending;
}

bool PendingReply::wait(MonotonicTime until) noexcept {
  RTPM_ASSERT(state_ != nullptr, "a call was begun");
  return state_->wait(until);
}

bool PendingReply::is_done() noexcept {
  return wait(MonotonicTime{});
}

Readiness PendingReply::readiness() noexcept {
  // No descriptor reports frames that arrived together with an earlier one.
  constexpr int kFrameCountMax = 32;
  RTPM_ASSERT(state_ != nullptr, "a call was begun");
  for (int i = 0; i < kFrameCountMax; ++i) {
    state_->channel->end_sleep();
    if (is_done()) return {};
    const Readiness next = state_->channel->announce_sleep();
    if (next.descriptor >= 0) return next;
  }
  return {.is_ready = false};
}

expected<ReplyLease, CallError> PendingReply::take() noexcept {
  static_cast<void>(wait(kNever));
  const PendingReply ended = std::move(*this);
  return ended.state_->take();
}

void PendingReply::cancel() noexcept {
  if (state_) state_->cancel();
}

struct ItemReader::State {
  explicit State(CallChannel* taken) noexcept : channel(taken) {}

  TakenChannel channel;
  CallOutcome outcome{.kind = CallOutcome::Kind::kGoing};
};

ItemReader::ItemReader() noexcept = default;
ItemReader::ItemReader(ItemReader&& other) noexcept = default;
ItemReader::ItemReader(std::unique_ptr<State> state) noexcept : state_(std::move(state)) {}

ItemReader& ItemReader::operator=(ItemReader&& other) noexcept {
  std::swap(state_, other.state_);
  return *this;
}

ItemReader::~ItemReader() {
  cancel();
  const rt::AllowAllocationScope is_allowed;
  state_.reset();
}

expected<ItemReader, CallError> Binding::open_stream(const MethodDescriptor& method,
                                                     ConstBytes request,
                                                     const StreamOptions& options) {
  RTPM_ASSERT(options.window >= 1 && options.window <= wire::kStreamWindow,
              "a stream takes 1 to 32 items at a time");
  RTPM_ASSERT(options.miss_count_max >= kMissCountMin && options.miss_count_max <= kMissCountMax,
              "2 to 6 signs of life may be missed");
  Impl::Plan plan = impl_->plan(method, options.call);
  // A stream has no deadline unless its caller sets one.
  if (!options.call.deadline) plan.deadline = kNever;
  plan.stream_window = options.window;
  plan.stream_silence = std::min<Duration>(options.miss_count_max * wire::kStreamAskIntervalMax,
                                           wire::kStreamSilence);
  plan.stream_pause_max = options.pause_max;
  Impl::Ready ready;
  if (auto made = impl_->make_ready(plan, plan.begun, ready); !made) {
    return unexpected{made.error()};
  }
  auto state = std::make_unique<ItemReader::State>(ready.channel);
  const auto kept = state->channel->keep(request);
  if (!kept) return unexpected{CallError::kTooLarge};
  if (auto begun = state->channel->begin(ready.parameters, *kept, rt::now()); !begun) {
    return unexpected{begun.error()};
  }
  return ItemReader(std::move(state));
}

bool ItemReader::is_open() const noexcept {
  if (!state_) return false;
  const auto kind = state_->outcome.kind;
  return kind == CallOutcome::Kind::kGoing || kind == CallOutcome::Kind::kItems;
}

expected<std::optional<ConstBytes>, CallError> ItemReader::next(MonotonicTime until) noexcept {
  RTPM_ASSERT(state_ != nullptr, "a stream was opened");
  state_->channel->end_sleep();
  while (true) {
    // Received items precede the end of the stream, even if both arrived together.
    if (const auto item = state_->channel->next_item()) return item;
    if (!is_open()) break;
    state_->outcome = state_->channel->finish(until, rt::now());
    if (state_->outcome.kind == CallOutcome::Kind::kGoing) return unexpected{CallError::kTimeout};
  }
  const CallOutcome& outcome = state_->outcome;
  if (outcome.kind != CallOutcome::Kind::kReply) return unexpected{outcome.error};
  if (outcome.status != wire::Status::kOk)
    return unexpected{refused(outcome.status, outcome.payload)};
  return std::optional<ConstBytes>{};
}

Readiness ItemReader::readiness() noexcept {
  return is_open() ? state_->channel->announce_sleep() : Readiness{};
}

void ItemReader::cancel() noexcept {
  if (!state_) return;
  // Even an ended stream occupies its channel until its items are taken.
  state_->channel->cancel();
  if (!is_open()) return;
  state_->outcome = {.kind = CallOutcome::Kind::kFailed, .error = CallError::kCancelled};
}

}  // namespace rtpm::rpc
