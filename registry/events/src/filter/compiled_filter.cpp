#include "filter/compiled_filter.hpp"

#include <algorithm>
#include <bit>

#include "rtpm/base/assert.hpp"

namespace rtpm::events {
namespace {

constexpr std::uint64_t bit(std::size_t index) noexcept {
  return std::uint64_t{1} << index;
}

template <class T>
bool compare(T value, Comparison comparison, T operand) noexcept {
  switch (comparison) {
    case Comparison::kEqual:
      return value == operand;
    case Comparison::kNotEqual:
      return value != operand;
    case Comparison::kLess:
      return value < operand;
    case Comparison::kLessOrEqual:
      return value <= operand;
    case Comparison::kGreater:
      return value > operand;
    case Comparison::kGreaterOrEqual:
      return value >= operand;
    case Comparison::kHasAnyBit:
      break;
  }
  if constexpr (std::is_integral_v<T>) return (value & operand) != 0;
  return false;
}

// The compiler has converted both to the kind of the field's type.
bool compare(const Scalar& value, Comparison comparison, std::uint64_t operand_bits) noexcept {
  switch (value.kind) {
    case Scalar::Kind::kSigned:
      return compare(value.integer, comparison, static_cast<std::int64_t>(operand_bits));
    case Scalar::Kind::kUnsigned:
      return compare(value.natural, comparison, operand_bits);
    case Scalar::Kind::kReal:
      break;
  }
  return compare(value.real, comparison, std::bit_cast<double>(operand_bits));
}

Scalar scalar_of(ScalarType type, std::uint64_t bits) noexcept {
  if (is_real(type)) return Scalar::of(std::bit_cast<double>(bits));
  if (is_signed(type)) return Scalar::of(static_cast<std::int64_t>(bits));
  return Scalar::of(bits);
}

}  // namespace

void CompiledFilter::start(MonotonicTime now) noexcept {
  for (Timer& timer : timers_) {
    timer.due = now + timer.span;
    timer.count = 0;
  }
}

bool CompiledFilter::is_match(const Node& node, const EventHeader& header) noexcept {
  return ((header.type ^ node.type) & node.type_mask) == 0 &&
         ((header.source ^ node.source) & node.source_mask) == 0;
}

// ev-5.2-4: each match has its own hops.
bool CompiledFilter::is_listed(const Node& node, const EventHeader& header) const noexcept {
  const auto begin = matches_.begin();
  const auto has_hops = [&](const Match& each) { return header.hops_left >= each.hops_min; };
  const auto types = begin + node.type_begin;
  const auto exact = std::lower_bound(
      begin + node.match_begin, types, header, [](const Match& each, const EventHeader& wanted) {
        return each.type != wanted.type ? each.type < wanted.type : each.source < wanted.source;
      });
  if (exact != types && exact->type == header.type && exact->source == header.source &&
      has_hops(*exact)) {
    return true;
  }
  const auto masks = begin + node.mask_begin;
  const auto of_type =
      std::lower_bound(types, masks, header.type,
                       [](const Match& each, EventType wanted) { return each.type < wanted; });
  if (of_type != masks && of_type->type == header.type && has_hops(*of_type)) return true;
  return std::any_of(masks, begin + node.match_end, [&](const Match& each) {
    return ((header.type ^ each.type) & each.type_mask) == 0 &&
           ((header.source ^ each.source) & each.source_mask) == 0 && has_hops(each);
  });
}

bool CompiledFilter::is_where(const Node& node, const EventHeader& header,
                              ConstBytes payload) noexcept {
  if (header.type != node.type || header.schema_id != node.schema_id) return false;
  const auto value = read_scalar(payload, node.path, node.field_type,
                                 scalar_of(node.field_type, node.default_bits));
  return value && compare(*value, node.comparison, node.operand_bits);
}

// Whether a node without state accepts the event, given its children's results.
bool CompiledFilter::evaluate(const Node& node, Bits accepted, const EventHeader& header,
                              ConstBytes payload) const noexcept {
  switch (node.kind) {
    case Filter::Kind::kNull:
      return true;
    case Filter::Kind::kMatch:
      return is_match(node, header);
    case Filter::Kind::kListed:
      return is_listed(node, header);
    case Filter::Kind::kWhere:
      return is_where(node, header, payload);
    case Filter::Kind::kAny:
      return (accepted & node.children) != 0;
    case Filter::Kind::kAll:
      return (accepted & node.children) == node.children;
    case Filter::Kind::kNot:
      return (accepted & node.children) == 0;
    default:
      return false;
  }
}

bool CompiledFilter::accepts(const EventHeader& header, ConstBytes payload) const noexcept {
  Bits accepted = 0;
  for (std::size_t i = 0; i < nodes_.size(); ++i) {
    if (evaluate(nodes_[i], accepted, header, payload)) accepted |= bit(i);
  }
  return (accepted & bit(nodes_.size() - 1)) != 0;
}

// Evaluates every node for the event, or for the timeout of node `timer`, which no other leaf
// accepts.
CompiledFilter::Bits CompiledFilter::judge(const EventRef& event,
                                           std::optional<std::size_t> timer) noexcept {
  Bits accepted = 0;
  const EventView view = event ? event.view() : EventView{};
  for (std::size_t i = 0; i < nodes_.size(); ++i) {
    const Node& node = nodes_[i];
    const bool is_any_or_all = node.kind == Filter::Kind::kAny || node.kind == Filter::Kind::kAll;
    const bool is_accepted = node.kind == Filter::Kind::kCorrelate ? fill(node, accepted, event)
                             : timer == i                          ? true
                             : timer && !is_any_or_all
                                 ? false
                                 : evaluate(node, accepted, view.header, view.payload);
    if (is_accepted) accepted |= bit(i);
  }
  return accepted;
}

std::span<CompiledFilter::Kept> CompiledFilter::kept_of(const Node& node) noexcept {
  return std::span(kept_).subspan(node.kept_begin,
                                  static_cast<std::size_t>(std::popcount(node.children)));
}
std::span<const CompiledFilter::Kept> CompiledFilter::kept_of(const Node& node) const noexcept {
  return std::span(kept_).subspan(node.kept_begin,
                                  static_cast<std::size_t>(std::popcount(node.children)));
}

// Stores the event that a child accepted; true if this completes the conjunction.
bool CompiledFilter::fill(const Node& node, Bits accepted, const EventRef& event) noexcept {
  if ((accepted & node.children) == 0) return false;
  Kept* chosen = nullptr;
  for (Kept& kept : kept_of(node)) {
    if ((accepted & bit(kept.child)) == 0) continue;
    if (!kept.is_filled) {
      chosen = &kept;
      break;
    }
    const auto age = [](const Kept& each) { return each.events[0].header().origin; };
    if (chosen == nullptr || age(kept) < age(*chosen)) chosen = &kept;
  }
  chosen->events.clear();
  collect(chosen->child, accepted, event, chosen->events);
  chosen->is_filled = true;
  return is_complete(node);
}

bool CompiledFilter::is_complete(const Node& node) const noexcept {
  MonotonicTime first = kNever;
  MonotonicTime last = MonotonicTime::min();
  for (const Kept& kept : kept_of(node)) {
    if (!kept.is_filled) return false;
    for (const EventRef& event : kept.events) {
      // A timeout has no origin.
      if (event.header().type == kTimeoutType) continue;
      first = std::min(first, event.header().origin);
      last = std::max(last, event.header().origin);
    }
  }
  // Unsigned, so that no times of a supplier can overflow.
  if (node.skew_ns == 0 || first >= last) return true;
  const auto apart =
      static_cast<std::uint64_t>(to_ns(last)) - static_cast<std::uint64_t>(to_ns(first));
  return apart <= static_cast<std::uint64_t>(node.skew_ns);
}

// How many events an accepting node delivers. The children of "all" share the newest event.
std::size_t CompiledFilter::delivered_count(std::size_t index, Bits accepted) const noexcept {
  const Node& node = nodes_[index];
  std::size_t count = 1;
  switch (node.kind) {
    case Filter::Kind::kAny:
      return delivered_count(delivering_child(node, accepted), accepted);
    case Filter::Kind::kAll:
      for (Bits left = node.children; left != 0; left &= left - 1) {
        count += delivered_count(static_cast<std::size_t>(std::countr_zero(left)), accepted) - 1;
      }
      return count;
    case Filter::Kind::kCorrelate:
      count = 0;
      for (const Kept& kept : kept_of(node))
        count += kept.events.size();
      return count;
    default:
      return count;
  }
}

// Returns the first accepting child of "any" with the most events. Each child delivers the newest
// event, so a completed conjunction includes the event of an accepting sibling.
std::size_t CompiledFilter::delivering_child(const Node& node, Bits accepted) const noexcept {
  std::size_t chosen = 0;
  std::size_t most = 0;
  for (Bits left = accepted & node.children; left != 0; left &= left - 1) {
    const auto child = static_cast<std::size_t>(std::countr_zero(left));
    const std::size_t count = delivered_count(child, accepted);
    if (count > most) {
      chosen = child;
      most = count;
    }
  }
  return chosen;
}

// Collects the delivery of an accepting node. The compiler has bounded its depth and size.
void CompiledFilter::collect(std::size_t index, Bits accepted, const EventRef& event,
                             Group& group) const noexcept {
  const Node& node = nodes_[index];
  switch (node.kind) {
    case Filter::Kind::kAny:
      collect(delivering_child(node, accepted), accepted, event, group);
      return;
    case Filter::Kind::kAll:
      for (Bits left = node.children; left != 0; left &= left - 1) {
        Group part;
        collect(static_cast<std::size_t>(std::countr_zero(left)), accepted, event, part);
        for (const EventRef& each : part) {
          if (std::find(group.begin(), group.end(), each) == group.end()) group.add(each);
        }
      }
      return;
    case Filter::Kind::kCorrelate:
      for (const Kept& kept : kept_of(node)) {
        for (const EventRef& each : kept.events)
          group.add(each);
      }
      return;
    default:
      group.add(event);
  }
}

// Collects the delivery and resets conjunctions and silences. Returns whether the root accepted.
bool CompiledFilter::finish(Bits accepted, const EventRef& event, MonotonicTime now,
                            Group& group) noexcept {
  const bool is_accepted = (accepted & bit(nodes_.size() - 1)) != 0;
  if (is_accepted) collect(nodes_.size() - 1, accepted, event, group);
  for (std::size_t i = 0; i < nodes_.size() && !kept_.empty(); ++i) {
    if (nodes_[i].kind != Filter::Kind::kCorrelate || (accepted & bit(i)) == 0) continue;
    for (Kept& kept : kept_of(nodes_[i])) {
      kept.is_filled = false;
      kept.events.clear();
    }
  }
  for (Timer& timer : timers_) {
    if (timer.kind == Filter::Kind::kSilence && (accepted & bit(timer.group)) != 0) {
      timer.due = now + timer.span;
    }
  }
  return is_accepted;
}

bool CompiledFilter::on_event(const EventRef& event, MonotonicTime now, Group& group) noexcept {
  if (is_stateless_) return accepts(event.header(), event.payload());
  const bool is_accepted = finish(judge(event, std::nullopt), event, now, group);
  if (group.size() == 1 && group[0] == event) group.clear();
  return is_accepted;
}

bool CompiledFilter::on_timeout(const Due& due, const EventRef& event, MonotonicTime now,
                                Group& group) noexcept {
  return finish(judge(event, due.node), event, now, group);
}

void CompiledFilter::release_events() noexcept {
  for (Kept& kept : kept_) {
    kept.is_filled = false;
    kept.events.clear();
  }
}

MonotonicTime CompiledFilter::next_time() const noexcept {
  MonotonicTime next = kNever;
  for (const Timer& timer : timers_)
    next = std::min(next, timer.due);
  return next;
}

std::optional<CompiledFilter::Due> CompiledFilter::take_due(MonotonicTime now) noexcept {
  const auto first = std::ranges::min_element(timers_, {}, &Timer::due);
  if (first == timers_.end() || first->due > now) return std::nullopt;
  const Due due{first->node, first->tag, first->due, ++first->count};
  if (first->kind == Filter::Kind::kOnce) {
    first->due = kNever;
  } else if (first->kind == Filter::Kind::kSilence) {
    first->due = now + first->span;
  } else {
    // Advances by whole periods: no drift, missed periods are skipped.
    const auto missed = (now - first->due) / first->span;
    first->due += (missed + 1) * first->span;
  }
  return due;
}

}  // namespace rtpm::events
