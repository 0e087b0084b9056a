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
#include "rtpm/predicate/comparison.hpp"

namespace rtpm::events {

/// Limits of a filter.
inline constexpr std::size_t kFilterDepthMax = 16;  ///< Nested nodes, including the root.
inline constexpr std::size_t kFilterNodeCountMax = 64;
inline constexpr std::size_t kGroupSizeMax = 32;     ///< Events per delivery.
inline constexpr std::size_t kMatchCountMax = 1024;  ///< Matches per list.
/// Bounds of a timeout.
inline constexpr Duration kTimeoutMin = std::chrono::microseconds{100};
inline constexpr Duration kTimeoutMax = std::chrono::hours{24};

/// The comparison of a payload field with an operand.
using Comparison = predicate::Comparison;

/// Accepts events whose type and source equal these, in the bits of the masks.
struct Match {
  EventType type = 0;
  std::uint32_t type_mask = 0;
  SourceId source = 0;
  std::uint32_t source_mask = 0;
  /// Accepts only events that may still be forwarded by at least this many hubs.
  std::uint8_t hops_min = 0;
  friend bool operator==(const Match&, const Match&) = default;
};

/// The predicate of a subscription: a tree, built with the functions below and compiled when
/// subscribing. tests/unit/events/filter/filter_table_test.cpp has a case for each sentence.
///
/// Every node sees every event, so a conjunction's state does not depend on its siblings.
/// @source   TAO's real-time event service, except for two quirks: a conjunction keeps the newest
///           event of each child, and no event matches by having the type or source 0
struct Filter {
  enum class Kind : std::uint8_t {
    kNull,   ///< Accepts every event.
    kMatch,  ///< Accepts by type and source.
    /// Accepts an event that any child accepts; delivers the largest of the children's deliveries.
    kAny,
    kAll,        ///< Accepts an event that all children accept.
    kNot,        ///< Accepts the events that its child rejects.
    kCorrelate,  ///< Conjunction: delivers one event of each child together.
    kWhere,      ///< Accepts events of a type by comparing a payload field.
    kOnce,       ///< Timeout: once, relative to the subscription.
    kEvery,      ///< Timeout: periodic, without drift.
    kSilence,    ///< Timeout: the enclosing group delivered nothing for a time.
    kListed,     ///< Accepts by a list of types and sources.
  };
  Kind kind = Kind::kNull;
  /// kMatch: see Match. kWhere: the type with the field.
  EventType type = 0;
  std::uint32_t type_mask = 0;
  SourceId source = 0;
  std::uint32_t source_mask = 0;
  std::string field{};  ///< kWhere: see FieldDescriptor::name.
  Comparison comparison = Comparison::kEqual;
  Scalar operand{};
  /// kCorrelate: maximum difference of origin times, unlimited if 0. Timeouts: the time.
  Duration span{};
  std::uint32_t tag = 0;  ///< Timeouts: the source of their events.
  std::vector<Filter> children{};
  std::vector<Match> matches{};  ///< kListed: at most kMatchCountMax.
};

inline constexpr std::uint32_t kWholeNumber = 0xffff'ffff;  ///< The mask of all bits.

/// Accepts every event.
[[nodiscard]] inline Filter everything() {
  return {};
}
/// Accepts events of a type, from any source.
[[nodiscard]] inline Filter of_type(EventType type) {
  return {.kind = Filter::Kind::kMatch, .type = type, .type_mask = kWholeNumber};
}
/// Accepts events of a type and source.
[[nodiscard]] inline Filter of_type(EventType type, SourceId source) {
  return {.kind = Filter::Kind::kMatch,
          .type = type,
          .type_mask = kWholeNumber,
          .source = source,
          .source_mask = kWholeNumber};
}
/// Accepts events whose type and source equal these, in the bits of the masks; mask 0 means any.
[[nodiscard]] inline Filter masked(EventType type, std::uint32_t type_mask, SourceId source,
                                   std::uint32_t source_mask) {
  return {.kind = Filter::Kind::kMatch,
          .type = type,
          .type_mask = type_mask,
          .source = source,
          .source_mask = source_mask};
}
/// Accepts events that any of `matches` accepts; an empty list accepts nothing. Counts as one node.
/// The look-up takes logarithmic time if masks have all bits or none.
[[nodiscard]] inline Filter listed(std::vector<Match> matches) {
  return {.kind = Filter::Kind::kListed, .matches = std::move(matches)};
}
/// Accepts events that any of `children` accepts. An event that completes a conjunction is
/// delivered once, within it, even if another child accepts it alone. If it completes several, it
/// is delivered in the largest one, or in the first of equally large ones. The others start over.
[[nodiscard]] inline Filter any_of(std::vector<Filter> children) {
  return {.kind = Filter::Kind::kAny, .children = std::move(children)};
}
/// Accepts events that all of `children` accept.
[[nodiscard]] inline Filter all_of(std::vector<Filter> children) {
  return {.kind = Filter::Kind::kAll, .children = std::move(children)};
}
/// Accepts events that `child` rejects.
[[nodiscard]] inline Filter none_of(Filter child) {
  Filter filter{.kind = Filter::Kind::kNot};
  filter.children.push_back(std::move(child));
  return filter;
}
/// Conjunction: the newest event of each of `children`, with origins at most `skew` apart
/// (unlimited if 0). An event fills the first empty slot of an accepting child; otherwise it
/// replaces the oldest event among the accepting children. Delivers in the order of the children,
/// then starts over.
[[nodiscard]] inline Filter correlate(std::vector<Filter> children, Duration skew = Duration{0}) {
  return {.kind = Filter::Kind::kCorrelate, .span = skew, .children = std::move(children)};
}
/// Accepts only events of `type` whose `field` satisfies the comparison.
[[nodiscard]] inline Filter where(EventType type, std::string field, Comparison comparison,
                                  Scalar operand) {
  return {.kind = Filter::Kind::kWhere,
          .type = type,
          .field = std::move(field),
          .comparison = comparison,
          .operand = operand};
}
/// A single timeout, `after` the subscription.
[[nodiscard]] inline Filter once(Duration after, std::uint32_t tag = 0) {
  return {.kind = Filter::Kind::kOnce, .span = after, .tag = tag};
}
/// A timeout every `period`, without drift; missed periods are skipped.
[[nodiscard]] inline Filter every(Duration period, std::uint32_t tag = 0) {
  return {.kind = Filter::Kind::kEvery, .span = period, .tag = tag};
}
/// A timeout whenever the enclosing group (its parent, or the subscription) delivered nothing for
/// `limit`. Its own delivery restarts the time, so it repeats every `limit` during silence.
[[nodiscard]] inline Filter silence(Duration limit, std::uint32_t tag = 0) {
  return {.kind = Filter::Kind::kSilence, .span = limit, .tag = tag};
}

}  // namespace rtpm::events
