#include "exchange/gate.hpp"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "filter/compiler.hpp"

namespace rtpm::events {
namespace {

unexpected<SetupError> refuse(const std::string& why) {
  return setup_error("The delivery policy is refused", why);
}

}  // namespace

expected<Gate, SetupError> Gate::make(const DeliveryPolicy& policy, const DescriptorSource& types) {
  if (policy.every_nth == 0) return refuse("every_nth is at least 1");
  if (policy.interval < Duration{0} || policy.interval > kTimeoutMax) {
    return refuse("an interval is not negative, and at most a day");
  }
  if (policy.deadbands.size() > kDeadbandCountMax) {
    return refuse("it has more than " + std::to_string(kDeadbandCountMax) + " deadbands");
  }
  if (policy.replay > kReplayMax) {
    return refuse("it replays more than " + std::to_string(kReplayMax) + " events");
  }
  const std::uint32_t capacity_max =
      policy.when_full == QueuePolicy::kKeepLatest ? kLatestQueueCapacityMax : kQueueCapacityMax;
  if (policy.queue_capacity == 0 || policy.queue_capacity > capacity_max) {
    return refuse("a queue of this kind holds 1 to " + std::to_string(capacity_max) + " events");
  }
  Gate gate;
  gate.every_nth_ = policy.every_nth;
  gate.interval_ = policy.interval;
  gate.is_trailing_ = policy.is_trailing;
  gate.is_per_source_ = policy.is_interval_per_source;
  if (gate.has_interval()) {
    gate.intervals_.reserve(gate.is_per_source_ ? 1 + kIntervalSourceMax : 1);
    gate.intervals_.emplace_back();
  }
  for (const Deadband& each : policy.deadbands) {
    const auto field = find_field(each.type, each.field, types);
    if (!field) return refuse("deadband: " + field.error().reason());
    if (!(each.threshold > 0) || std::isinf(each.threshold)) {
      return refuse("the deadband of '" + each.field + "' is not above 0");
    }
    gate.bands_.push_back({each.type, (*field)->type, (*field)->path,
                           types.find(each.type)->schema_id, (*field)->default_value,
                           each.threshold});
  }
  if (!gate.bands_.empty()) gate.lasts_.reserve(kLastCountMax);
  return gate;
}

bool Gate::is_beyond(std::uint32_t band, const EventView& event) const noexcept {
  const Band& its = bands_[band];
  const auto value = read_scalar(event.payload, its.path, its.field_type, its.default_value);
  // An unreadable field does not suppress the event.
  if (!value || event.header.schema_id != its.schema_id) return true;
  const auto last = std::ranges::find_if(lasts_, [&](const Last& each) {
    return each.band == band && each.source == event.header.source;
  });
  if (last == lasts_.end()) return true;
  // Negated so that NaN counts as exceeding the deadband.
  return !(std::abs(value->as_real() - last->value) < its.threshold);
}

bool Gate::exceeds_deadband(const EventView& event) noexcept {
  bool is_watched = false;
  for (std::uint32_t i = 0; i < bands_.size(); ++i) {
    if (bands_[i].type != event.header.type) continue;
    if (is_beyond(i, event)) return true;
    is_watched = true;
  }
  return !is_watched;
}

void Gate::remember(const EventView& event) noexcept {
  for (std::uint32_t i = 0; i < bands_.size(); ++i) {
    const Band& its = bands_[i];
    if (its.type != event.header.type || its.schema_id != event.header.schema_id) continue;
    const auto value = read_scalar(event.payload, its.path, its.field_type, its.default_value);
    if (!value) continue;
    const Last last{i, event.header.source, value->as_real()};
    const auto known = std::ranges::find_if(lasts_, [&](const Last& each) {
      return each.band == i && each.source == event.header.source;
    });
    if (known != lasts_.end()) {
      *known = last;
    } else if (lasts_.size() < kLastCountMax) {
      lasts_.push_back(last);
    } else {
      lasts_[next_last_++ % kLastCountMax] = last;
    }
  }
}

bool Gate::admit(const EventRef& event, MonotonicTime now) noexcept {
  if (every_nth_ == 1 && interval_ == Duration{0} && bands_.empty()) return true;
  if (event && !bands_.empty() && !exceeds_deadband(event.view())) {
    ++omitted_count_;
    return false;
  }
  if (nth_++ % every_nth_ != 0) {
    ++omitted_count_;
    return false;
  }
  if (has_interval() && !opens(event, now)) {
    ++omitted_count_;
    return false;
  }
  if (event && !bands_.empty()) remember(event.view());
  return true;
}

Gate::Interval& Gate::interval_of(const EventRef& event, MonotonicTime now) noexcept {
  if (!is_per_source_ || !event) return intervals_.front();
  const EventHeader& header = event.header();
  Interval* idle = nullptr;
  for (std::size_t i = 1; i < intervals_.size(); ++i) {
    Interval& each = intervals_[i];
    if (each.type == header.type && each.source == header.source) return each;
    if (idle == nullptr && !each.held && each.next_open <= now) idle = &each;
  }
  const Interval fresh{.type = header.type, .source = header.source};
  if (intervals_.size() < intervals_.capacity()) return intervals_.emplace_back(fresh);
  // An expired interval has no state to keep: reuse it.
  if (idle != nullptr) return *idle = fresh;
  return intervals_.front();
}

bool Gate::opens(const EventRef& event, MonotonicTime now) noexcept {
  Interval& interval = interval_of(event, now);
  if (now < interval.next_open) {
    if (event && is_trailing_) {
      interval.held = event;
      next_due_ = std::min(next_due_, interval.next_open);
    }
    return false;
  }
  // Keeps the phase under continuous load; restarts from `now` after a pause.
  interval.next_open =
      interval.next_open > now - interval_ ? interval.next_open + interval_ : now + interval_;
  interval.held = EventRef();
  return true;
}

EventRef Gate::take_held(MonotonicTime now) noexcept {
  if (now < next_due_) return {};
  Interval* due = nullptr;
  next_due_ = kNever;
  for (Interval& each : intervals_) {
    if (!each.held) continue;
    if (due == nullptr && each.next_open <= now) {
      due = &each;
    } else {
      next_due_ = std::min(next_due_, each.next_open);
    }
  }
  if (due == nullptr) return {};
  due->next_open = due->next_open + interval_ > now ? due->next_open + interval_ : now + interval_;
  --omitted_count_;
  if (!bands_.empty()) remember(due->held.view());
  return std::move(due->held);
}

}  // namespace rtpm::events
