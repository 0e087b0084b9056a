#pragma once

#include <gtest/gtest.h>

#include <array>
#include <bit>
#include <chrono>
#include <cstdint>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "exchange/exchange.hpp"
#include "filter/catalog.hpp"

/// The common parts of the tests of filters and deliveries: an event type, and a subscription that
/// gets events on a clock that the test keeps.
namespace rtpm::events::test {

inline constexpr EventType kPose = 5;
inline constexpr EventType kButton = 6;
inline constexpr EventType kGaze = 7;
inline constexpr std::uint64_t kPoseSchema = 0x1111;

/// The payload of a pose: a bare struct.
struct PosePayload {
  double x = 0;
  float force = 0;
  std::int16_t step = 0;
  std::uint8_t is_held = 0;
  std::uint8_t keys = 0;
};

inline constexpr std::array kPoseFields{
    FieldDescriptor{"x", ScalarType::kDouble, {.offset = 0}},
    FieldDescriptor{"force", ScalarType::kFloat, {.offset = 8}},
    FieldDescriptor{"step", ScalarType::kInt16, {.offset = 12}},
    FieldDescriptor{"is_held", ScalarType::kBool, {.offset = 14}},
    FieldDescriptor{"keys", ScalarType::kUint8, {.offset = 15}},
};

inline TypeCatalog pose_catalog() {
  TypeCatalog catalog;
  const auto added = catalog.add({kPose, "lab.Pose", kPoseSchema, kPoseFields});
  EXPECT_TRUE(added);
  return catalog;
}

inline MonotonicTime at(double ms) {
  return time_from_ns(static_cast<std::int64_t>(ms * 1e6));
}

/// "5.0" is an event of type 5 and source 0, "@9" the timeout with tag 9, "~5.0" one replayed.
inline std::string name_of(const EventHeader& header) {
  if (header.type == kTimeoutType) return "@" + std::to_string(header.source);
  return (header.is_replayed ? "~" : "") + std::to_string(header.type) + "." +
         std::to_string(header.source) + "#" + std::to_string(header.sequence);
}

/// One subscription and its deliveries: each is "5.0#1", a group "5.0#1+6.0#1".
class Table {
 public:
  explicit Table(const Filter& filter, const DeliveryPolicy& policy = {},
                 const ExchangeLimits& limits = {})
      : exchange(limits) {
    number = subscribe(filter, policy);
  }

  SubscriptionNumber subscribe(const Filter& filter, const DeliveryPolicy& policy = {}) {
    auto prepared = Exchange::prepare(filter, policy, catalog);
    EXPECT_TRUE(prepared) << prepared.error().text();
    const auto placed = exchange.subscribe(std::move(*prepared), now);
    EXPECT_TRUE(placed);
    return placed.value_or(0);
  }

  /// Sets the clock; earlier timeouts fire first, each at its own time.
  void advance(double ms) {
    while (exchange.next_time() <= at(ms)) {
      now = exchange.next_time();
      exchange.on_time(now);
    }
    now = at(ms);
  }

  /// An event that happens now; sequences count by type and source.
  void push(EventType type, SourceId source = 0, const PosePayload& payload = {}) {
    const std::uint64_t sequence = ++sequences[{type, source}];
    const EventHeader header{.type = type,
                             .source = source,
                             .sequence = sequence,
                             .origin = now,
                             .hub_received = now,
                             .schema_id = kPoseSchema};
    const auto bytes = std::as_bytes(std::span<const PosePayload, 1>(&payload, 1));
    EXPECT_TRUE(exchange.offer({header, bytes}, now));
  }
  void push_at(double ms, EventType type, SourceId source = 0, const PosePayload& payload = {}) {
    advance(ms);
    push(type, source, payload);
  }

  /// The deliveries since the last call, separated by blanks.
  std::string got() { return got(number); }
  std::string got(SubscriptionNumber of) {
    std::string text;
    for (DeliveryQueue& queue = exchange.queue(of); !queue.empty(); queue.pop()) {
      text += name_of(queue[0].event.header());
      text += queue[0].is_continued ? "+" : " ";
    }
    if (!text.empty()) text.pop_back();
    return text;
  }

  TypeCatalog catalog = pose_catalog();
  Exchange exchange;
  SubscriptionNumber number = 0;
  MonotonicTime now{};
  std::map<std::pair<EventType, SourceId>, std::uint64_t> sequences{};
};

}  // namespace rtpm::events::test
