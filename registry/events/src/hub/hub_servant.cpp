#include <utility>

#include "hub/hub_impl.hpp"
#include "hub/hub_rights.hpp"
#include "rtpm/base/printable.hpp"
#include "rtpm/events/defaults.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/host.hpp"
#include "rtpm/rt/memory.hpp"

// The hub's methods. All except push() allocate.
namespace rtpm::events {
namespace {

// The escaped name, for reports and logs.
std::string name_of(const flatbuffers::String* name) {
  constexpr std::size_t kNameSizeMax = 64;
  return name == nullptr ? std::string() : printable(name->string_view(), kNameSizeMax);
}

SupplierCounts counts_of(const IntakeCounters& counters) noexcept {
  return {counters.taken_count, counters.over_quota_count, counters.too_large_count,
          counters.bad_count, counters.no_memory_count};
}

flatbuffers::Offset<LinkEntry> link_entry_of(flatbuffers::FlatBufferBuilder& builder,
                                             const LinkStatus& status) {
  const LinkCounts counts(status.taken_count, status.repeated_count, status.refused_count,
                          status.losses.total(), status.interruption_count,
                          status.last_gap.count());
  const auto reason = status.reason.empty() ? 0 : builder.CreateString(status.reason);
  return CreateLinkEntry(builder, builder.CreateString(status.target),
                         static_cast<LinkCondition>(status.state), reason, status.peer_epoch,
                         static_cast<std::uint32_t>(status.interest_count), &counts);
}

}  // namespace

HubFacts HubImpl::facts() const noexcept {
  return {epoch_, clock_domain_, to_ns(rt::now()), ring_ ? ring_->id() : 0,
          exchange_.store().payload_size_max()};
}

// Only callers that may observe all events are told about the ring, which receives all events.
rpc::Result<HubFacts> HubImpl::about(const rpc::CallContext& context) {
  HubFacts about = facts();
  if (!may_use_all(context.identity, Role::kObserve)) {
    about = {about.epoch(), about.clock_domain(), about.time_ns(), 0, about.payload_size_max()};
  }
  return about;
}

rpc::Result<void> HubImpl::push(const PushRequest& request, const rpc::CallContext& context) {
  const auto* events = request.events();
  const ConstBytes batch = std::as_bytes(std::span(events->data(), events->size()));
  if (!may_push(context.identity, batch)) return unexpected{rpc::Refusal::kNotAllowed};
  push(request.supplier(), batch, context.priority);
  return {};
}

expected<void, SetupError> HubImpl::add_types(const Types* types) {
  if (types == nullptr) return {};
  for (const TypeEntry* each : *types) {
    if (auto added = types_.add(descriptor_of(*each).descriptor); !added) return added;
  }
  return {};
}

// Why the caller's grants do not allow it to receive the events that the filter may accept; empty
// if they do.
std::string HubImpl::refusal_of(const FilterNode& filter, const Types* types, bool is_broadcast,
                                const rpc::Caller* caller) {
  const auto wanted = filter_of(filter);
  // prepare() reports the error.
  if (!wanted || may_use_all(caller, Role::kObserve)) return {};
  bool may_have = !is_broadcast && may_receive(caller, interest_set_of(*wanted));
  if (types != nullptr) {
    for (const TypeEntry* each : *types)
      may_have =
          may_have && may_use_type(caller, Role::kObserve, descriptor_of(*each).descriptor.type);
  }
  if (may_have) return {};
  return "The hub's grants do not let this caller have all that its filter may accept: that takes "
         "the role observe on " +
         std::string(kHubPath) + "/TYPE of each type, or on " + std::string(kHubPath) + ".";
}

expected<Exchange::Prepared, SetupError> HubImpl::prepare(const FilterNode& filter,
                                                          const DeliveryEntry& delivery,
                                                          const Types* types, bool is_broadcast) {
  const auto wanted = filter_of(filter);
  const auto policy = policy_of(delivery);
  if (!wanted || !policy) {
    return setup_error("The filter is too large, or of a later release than the hub");
  }
  const std::lock_guard lock(types_mutex_);
  if (auto added = add_types(types); !added) return unexpected{std::move(added.error())};
  return Exchange::prepare(*wanted, *policy, types_, is_broadcast);
}

void HubImpl::refuse(rpc::TableWriter<Batch>& items, std::string_view why) noexcept {
  const std::lock_guard lock(mutex_);
  builder_.build_refusal(why);
  static_cast<void>(items.write(builder_.item()));
  items.finish();
}

void HubImpl::subscribe(const SubscribeRequest& request, rpc::TableWriter<Batch> items,
                        const rpc::CallContext& context) {
  const rt::AllowAllocationScope is_allowed;
  const bool reads_ring = ring_ != nullptr && request.ring() == ring_->id();
  if (request.ring() != 0 && !reads_ring) {
    return refuse(items, "The hub has another ring: ask for it again.");
  }
  const bool is_multicast = multicast_ != nullptr && request.multicast() == multicast_->id();
  if (request.multicast() != 0 && !is_multicast) {
    return refuse(items, "The hub has another multicast: ask for it again.");
  }
  if (const auto why = refusal_of(*request.filter(), request.types(), reads_ring || is_multicast,
                                  context.identity);
      !why.empty()) {
    return refuse(items, why);
  }
  // ev-5.2-5
  if (request.linking_hub() == epoch_) return refuse(items, "A hub is not linked to itself.");
  auto prepared =
      prepare(*request.filter(), *request.delivery(), request.types(), reads_ring || is_multicast);
  if (!prepared) return refuse(items, prepared.error().text());
  Outlet outlet;
  outlet.id = rt::random_u64();
  const std::uint64_t id = outlet.id;
  outlet.name = name_of(request.name());
  outlet.program = name_of(request.program());
  outlet.process = request.process();
  outlet.host = context.caller;
  outlet.begun = rt::now();
  outlet.writer = std::move(items);
  outlet.is_welcome_due = true;
  outlet.is_latest_only =
      static_cast<QueuePolicy>(request.delivery()->when_full()) == QueuePolicy::kKeepLatest;
  // Added first, so that the subscription can't end before its interest is known.
  add_interest_set(id, interest_set_of(*filter_of(*request.filter())), request.linking_hub());
  {
    const WakeAfter wake_after(*this);
    const std::lock_guard lock(mutex_);
    const MonotonicTime now = rt::now();
    const auto slot = exchange_.next_number();
    std::uint64_t position = 0;
    if (is_multicast && slot) {
      position = multicast_->begin_slot(*slot, outlet.id);
    } else if (reads_ring && slot) {
      position = ring_->begin_slot(*slot, outlet.id);
    }
    if (const auto number = exchange_.subscribe(std::move(*prepared), now)) {
      outlet.welcome = Welcome(outlet.id, epoch_, to_ns(now), *number, position);
      std::swap(outlets_[*number], outlet);
      pump(*number, now);
      pump_ready(now);
      ring_if_needed(now);
      return;
    }
    if (is_multicast && slot) multicast_->end_slot(*slot);
  }
  remove_interest_set(id);
  refuse(outlet.writer, "The hub is full: it has its maximum of subscriptions.");
}

std::optional<SubscriptionNumber> HubImpl::find(std::uint64_t id) const noexcept {
  const auto found = std::ranges::find(outlets_, id, &Outlet::id);
  if (id == 0 || found == outlets_.end() || found->is_dead) return std::nullopt;
  return static_cast<SubscriptionNumber>(found - outlets_.begin());
}

rpc::Result<void> HubImpl::change(const ChangeRequest& request,
                                  rpc::ReplyBuilder<ChangeReply>& reply,
                                  const rpc::CallContext& context) {
  const rt::AllowAllocationScope is_allowed;
  std::string refusal = refusal_of(*request.filter(), request.types(), false, context.identity);
  if (!refusal.empty()) return unexpected{rpc::Refusal::kNotAllowed};
  auto prepared = prepare(*request.filter(), *request.delivery(), request.types());
  bool is_changed = false;
  if (prepared) {
    const WakeAfter wake_after(*this);
    const std::lock_guard lock(mutex_);
    const auto number = find(request.subscription());
    if (!number) return unexpected{rpc::Refusal::kGone};
    const MonotonicTime now = rt::now();
    if (exchange_.change(*number, *prepared, now)) {
      outlets_[*number].is_latest_only =
          static_cast<QueuePolicy>(request.delivery()->when_full()) == QueuePolicy::kKeepLatest;
      is_changed = true;
      pump_ready(now);
      ring_if_needed(now);
    } else {
      refusal = "The hub is full: its subscriptions have its maximum of types and sources.";
    }
  } else {
    refusal = prepared.error().text();
  }
  if (is_changed) {
    change_interest_set(request.subscription(), interest_set_of(*filter_of(*request.filter())));
  }
  auto& builder = reply.builder();
  const auto text = refusal.empty() ? 0 : builder.CreateString(refusal);
  reply.finish(CreateChangeReply(builder, text));
  return {};
}

rpc::Result<void> HubImpl::control(const Control& request, const rpc::CallContext&) {
  const WakeAfter wake_after(*this);
  const std::lock_guard lock(mutex_);
  const auto number = find(request.subscription());
  if (!number) return unexpected{rpc::Refusal::kGone};
  Outlet& outlet = outlets_[*number];
  const MonotonicTime now = rt::now();
  switch (request.action()) {
    case Action::Suspend:
    case Action::Resume:
      outlet.is_suspended = request.action() == Action::Suspend;
      exchange_.set_suspended(*number, outlet.is_suspended);
      // Losses are reported at the end of a suspension, not for each event.
      pump(*number, now);
      break;
    case Action::End:
      outlet.writer.finish();
      end(outlet, DisconnectReason::kUnsubscribed);
      // A reader of the ring sleeps there; wake it to check its stream.
      wake_bits_.fetch_or(1U << (*number % 32));
      break;
    default:
      return unexpected{rpc::Refusal::kBadRequest};
  }
  ring_if_needed(now);
  return {};
}

rpc::Result<void> HubImpl::note(const Progress& progress, const rpc::CallContext&) {
  const std::lock_guard lock(mutex_);
  const auto number = find(progress.subscription());
  if (!number) return unexpected{rpc::Refusal::kGone};
  outlets_[*number].progress = progress;
  outlets_[*number].noted = rt::now();
  return {};
}

Duration HubImpl::lag_of(SubscriptionNumber number, MonotonicTime now) noexcept {
  constexpr Duration kNoteMax = std::chrono::seconds{3};
  Duration lag{0};
  if (const DeliveryQueue& queue = exchange_.queue(number); !queue.empty()) {
    lag = now - queue[0].event.header().hub_received;
  }
  const Outlet& outlet = outlets_[number];
  if (outlet.noted == kNever) return lag;
  const Duration silence = now - outlet.noted;
  return std::max(lag, silence > kNoteMax ? silence : Duration{outlet.progress.lag_ns()});
}

rpc::Result<void> HubImpl::attend(const AttendRequest& request,
                                  rpc::ReplyBuilder<AttendReply>& reply,
                                  const rpc::CallContext& context) {
  const rt::AllowAllocationScope is_allowed;
  if (request.types() != nullptr) {
    for (const TypeEntry* each : *request.types()) {
      const EventType type = descriptor_of(*each).descriptor.type;
      if (!may_use_type(context.identity, Role::kCommand, type)) {
        return unexpected{rpc::Refusal::kNotAllowed};
      }
    }
  }
  std::string refusal;
  {
    const std::lock_guard lock(types_mutex_);
    if (auto added = add_types(request.types()); !added) refusal = added.error().text();
  }
  SupplierCounts counts;
  {
    const std::lock_guard lock(mutex_);
    Intake::Supplier& supplier = intake_.find(request.supplier(), rt::now());
    if (supplier.name.empty()) supplier.name = name_of(request.name());
    counts = counts_of(supplier.counters);
  }
  auto& builder = reply.builder();
  const auto text = refusal.empty() ? 0 : builder.CreateString(refusal);
  reply.finish(CreateAttendReply(builder, text, epoch_, &counts));
  return {};
}

rpc::Result<void> HubImpl::types(rpc::ReplyBuilder<TypesReply>& reply,
                                 const rpc::CallContext& context) {
  const rt::AllowAllocationScope is_allowed;
  TypesReplyT list;
  {
    const std::lock_guard lock(types_mutex_);
    for (const EventDescriptor* type : types_.list()) {
      if (!may_use_type(context.identity, Role::kObserve, type->type)) continue;
      list.types.push_back(entry_of(*type));
    }
  }
  reply.finish(CreateTypesReply(reply.builder(), &list));
  return {};
}

rpc::Result<void> HubImpl::report(rpc::ReplyBuilder<ReportReply>& reply,
                                  const rpc::CallContext& context) {
  const rt::AllowAllocationScope is_allowed;
  if (!may_use_all(context.identity, Role::kObserve)) {
    return unexpected{rpc::Refusal::kNotAllowed};
  }
  auto& builder = reply.builder();
  std::vector<flatbuffers::Offset<SubscriptionEntry>> subscriptions;
  std::vector<flatbuffers::Offset<SupplierEntry>> suppliers;
  const HubFacts now = facts();
  std::vector<flatbuffers::Offset<LinkEntry>> links;
  for (const LinkStatus& each : this->links())
    links.push_back(link_entry_of(builder, each));
  std::vector<flatbuffers::Offset<DisconnectEntry>> disconnects;
  for (const Disconnect& each : this->disconnects(0)) {
    disconnects.push_back(CreateDisconnectEntry(builder, builder.CreateString(each.name),
                                                static_cast<DisconnectCause>(each.reason),
                                                to_ns(each.time)));
  }
  const DisconnectCounters gone = disconnect_counters();
  const DisconnectCounts disconnect_counts(gone.unsubscribed_count, gone.left_count,
                                           gone.silent_count, gone.queue_full_count);
  const std::vector<std::uint64_t> linking = linking_subscriptions();
  const std::lock_guard lock(mutex_);
  const MonotonicTime time = rt::now();
  for (SubscriptionNumber i = 0; i < outlets_.size(); ++i) {
    const Outlet& outlet = outlets_[i];
    if (outlet.id == 0) continue;
    const SubscriptionCounters counters = exchange_.counters(i);
    const LossCounts losses = events::counts_of(counters.losses);
    const auto waiting = static_cast<std::uint32_t>(exchange_.queue(i).size());
    subscriptions.push_back(CreateSubscriptionEntry(
        builder, builder.CreateString(outlet.name), counters.accepted_count, counters.omitted_count,
        counters.delivered_count, waiting, &losses, outlet.is_suspended,
        exchange_.is_broadcast(i) && !receives_multicast(i),
        std::ranges::find(linking, outlet.id) != linking.end(), receives_multicast(i),
        builder.CreateString(outlet.program), outlet.process,
        builder.CreateString(to_string(outlet.host)), (time - outlet.begun).count(),
        lag_of(i, time).count(), outlet.progress.received(), outlet.progress.lost()));
  }
  for (const Intake::Supplier& each : intake_.suppliers()) {
    if (each.tag == 0) continue;
    const SupplierCounts counts = counts_of(each.counters);
    suppliers.push_back(CreateSupplierEntry(builder, builder.CreateString(each.name), &counts));
  }
  reply.finish(CreateReportReply(builder, &now, builder.CreateVector(subscriptions),
                                 builder.CreateVector(suppliers), builder.CreateVector(links),
                                 &disconnect_counts, builder.CreateVector(disconnects)));
  return {};
}

}  // namespace rtpm::events
