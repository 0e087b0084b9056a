#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "rtpm/base/time.hpp"
#include "rtpm/events/event.hpp"
#include "rtpm/events/scalar.hpp"

namespace rtpm::events {

/// What a filter may be at most.
inline constexpr std::size_t kFilterDepthMax = 16;  ///< Nodes in each other, the root included.
inline constexpr std::size_t kFilterNodeCountMax = 64;
inline constexpr std::size_t kGroupSizeMax = 32;     ///< Events that a filter delivers together.
inline constexpr std::size_t kMatchCountMax = 1024;  ///< Of a list.
/// No timeout comes more often, none waits longer.
inline constexpr Duration kTimeoutMin = std::chrono::microseconds{100};
inline constexpr Duration kTimeoutMax = std::chrono::hours{24};

/// How a predicate compares a field with its operand.
enum class Comparison : std::uint8_t {
  kEqual,
  kNotEqual,
  kLess,
  kLessOrEqual,
  kGreater,
  kGreaterOrEqual,
  kHasAnyBit,  ///< Of an integer: one of the operand's bits is set.
};

/// Events whose type and source agree with these in the bits of the masks.
struct Match {
  EventType type = 0;
  std::uint32_t type_mask = 0;
  SourceId source = 0;
  std::uint32_t source_mask = 0;
  /// Only those that as many further hubs may send on.
  std::uint8_t hops_min = 0;
  friend bool operator==(const Match&, const Match&) = default;
};

/// Which events a subscription wants: a tree, made with the functions below, compiled when
/// subscribing. What each kind means is a promise; tests/unit/events/filter_table_test.cpp has a
/// case for each sentence.
///
/// Every node sees every event, so that what a conjunction keeps does not hang on its neighbours.
/// @source   TAO's real-time event service, but for two quirks: a conjunction keeps the newest
///           event of each child, and no event matches by having the type or source 0
struct Filter {
  enum class Kind : std::uint8_t {
    kNull,       ///< Accepts every event.
    kMatch,      ///< Accepts by type and source.
    kAny,        ///< Accepts what a child accepts; delivers what the first of them does.
    kAll,        ///< Accepts an event that all children accept.
    kNot,        ///< Accepts the events that its child does not.
    kCorrelate,  ///< Conjunction: waits for an event of each child and delivers them together.
    kWhere,      ///< Accepts events of a type whose payload has a field as compared.
    kOnce,       ///< Timeout: once, a time after the subscription.
    kEvery,      ///< Timeout: again and again, without drift.
    kSilence,    ///< Timeout: when the group around it has delivered nothing for a time.
    kListed,     ///< Accepts by type and source what one of a list does.
  };
  Kind kind = Kind::kNull;
  /// kMatch: an event's type and source agree with these in the bits of the masks. kWhere: the type
  /// of the events that have the field.
  EventType type = 0;
  std::uint32_t type_mask = 0;
  SourceId source = 0;
  std::uint32_t source_mask = 0;
  std::string field{};  ///< kWhere: as FieldDescriptor::name.
  Comparison comparison = Comparison::kEqual;
  Scalar operand{};
  /// kCorrelate: how far apart the events may have happened, 0: any. Timeouts: the time.
  Duration span{};
  std::uint32_t tag = 0;  ///< Of a timeout: tells it from others; its events have it as source.
  std::vector<Filter> children{};
  std::vector<Match> matches{};  ///< kListed: at most kMatchCountMax.
};

inline constexpr std::uint32_t kWholeNumber = 0xffff'ffff;  ///< The mask of all bits.

/// Every event.
[[nodiscard]] inline Filter everything() {
  return {};
}
/// Events of a type, from anybody.
[[nodiscard]] inline Filter of_type(EventType type) {
  return {.kind = Filter::Kind::kMatch, .type = type, .type_mask = kWholeNumber};
}
/// Events of a type and source.
[[nodiscard]] inline Filter of_type(EventType type, SourceId source) {
  return {.kind = Filter::Kind::kMatch,
          .type = type,
          .type_mask = kWholeNumber,
          .source = source,
          .source_mask = kWholeNumber};
}
/// Events whose type and source agree in the bits of the masks; a mask of 0: any.
[[nodiscard]] inline Filter masked(EventType type, std::uint32_t type_mask, SourceId source,
                                   std::uint32_t source_mask) {
  return {.kind = Filter::Kind::kMatch,
          .type = type,
          .type_mask = type_mask,
          .source = source,
          .source_mask = source_mask};
}
/// What one of `matches` accepts; of no match: nothing. For many types and sources at once: it
/// counts as one node, and an event is judged in logarithmic time where masks are whole or 0.
[[nodiscard]] inline Filter listed(std::vector<Match> matches) {
  return {.kind = Filter::Kind::kListed, .matches = std::move(matches)};
}
/// What one of `children` accepts.
[[nodiscard]] inline Filter any_of(std::vector<Filter> children) {
  return {.kind = Filter::Kind::kAny, .children = std::move(children)};
}
/// What all of `children` accept at once.
[[nodiscard]] inline Filter all_of(std::vector<Filter> children) {
  return {.kind = Filter::Kind::kAll, .children = std::move(children)};
}
/// What `child` does not accept.
[[nodiscard]] inline Filter none_of(Filter child) {
  Filter filter{.kind = Filter::Kind::kNot};
  filter.children.push_back(std::move(child));
  return filter;
}
/// One event of each of `children`, the newest of each, that happened at most `skew` apart (0: any
/// time). An event goes to the first child that accepts it and has none yet, else to the one of
/// those accepting it whose event is the oldest. Delivers them in the order of the children, then
/// begins anew.
[[nodiscard]] inline Filter correlate(std::vector<Filter> children, Duration skew = Duration{0}) {
  return {.kind = Filter::Kind::kCorrelate, .span = skew, .children = std::move(children)};
}
/// Events of `type` whose `field` compares so; of no other type.
[[nodiscard]] inline Filter where(EventType type, std::string field, Comparison comparison,
                                  Scalar operand) {
  return {.kind = Filter::Kind::kWhere,
          .type = type,
          .field = std::move(field),
          .comparison = comparison,
          .operand = operand};
}
/// A timeout `after` the subscription, once.
[[nodiscard]] inline Filter once(Duration after, std::uint32_t tag = 0) {
  return {.kind = Filter::Kind::kOnce, .span = after, .tag = tag};
}
/// A timeout every `period`, without drift; what was missed is not made up for.
[[nodiscard]] inline Filter every(Duration period, std::uint32_t tag = 0) {
  return {.kind = Filter::Kind::kEvery, .span = period, .tag = tag};
}
/// A timeout whenever the group around it (its parent, or the subscription) delivered nothing for
/// `limit`. Its own delivery counts, too, so in lasting silence it comes every `limit`.
[[nodiscard]] inline Filter silence(Duration limit, std::uint32_t tag = 0) {
  return {.kind = Filter::Kind::kSilence, .span = limit, .tag = tag};
}

}  // namespace rtpm::events
