#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "exchange/exchange.hpp"
#include "filter/catalog.hpp"
#include "rtpm/base/assert.hpp"
#include "rtpm/base/time.hpp"

/// The hub's core without a server.
namespace rtpm::bench::micro {

/// Counts broadcast events, as shared memory would be written once for each.
class BroadcastCounter final : public events::Broadcaster {
 public:
  void broadcast(std::span<const events::SubscriptionNumber> to,
                 std::span<const events::EventRef>) noexcept override {
    count += to.size();
  }
  std::uint64_t count = 0;
};

/// Rejects every event that Crowd offers, once its whole program has run.
inline events::Filter by_value(std::uint32_t type) {
  return events::all_of(
      {events::of_type(type),
       events::where(type, "x", events::Comparison::kGreater, events::Scalar::of(2.0))});
}

/// A hub's core with 100 subscriptions of each of some types.
class Crowd {
 public:
  /// `is_broadcast`: accepted events go to the counter, otherwise to each subscription's queue,
  /// which holds one event.
  Crowd(std::uint32_t type_count, bool is_broadcast, events::Filter (*make_filter)(std::uint32_t))
      : type_count_(type_count),
        subscription_count_(100 * type_count),
        exchange_({.subscription_count_max = subscription_count_,
                   .interest_count_max = subscription_count_},
                  &counter_) {
    for (std::uint32_t type = 1; type <= type_count; ++type) {
      const auto added = catalog_.add({type, "Sample", kSchema, kFields});
      RTPM_ASSERT(added.has_value(), "a type can be added");
    }
    for (std::uint32_t i = 0; i < subscription_count_; ++i) {
      auto prepared = events::Exchange::prepare(make_filter(1 + i % type_count),
                                                {.queue_capacity = 1}, catalog_, is_broadcast);
      RTPM_ASSERT(prepared && exchange_.subscribe(std::move(*prepared), {}), "all can subscribe");
    }
  }

  /// Offers one event, of the types in turn; returns whether the exchange accepted it.
  bool offer() noexcept {
    const std::array<double, 4> payload{1, 2, 3, 4};
    const events::EventHeader header{.type = 1 + next_++ % type_count_, .schema_id = kSchema};
    return exchange_
        .offer({header, std::as_bytes(std::span(payload))}, time_from_ns(time_ns_ += 1'000'000))
        .has_value();
  }

 private:
  static constexpr std::uint64_t kSchema = 7;
  static constexpr std::array kFields{
      events::FieldDescriptor{"x", events::ScalarType::kDouble, {.offset = 0}}};

  std::uint32_t type_count_;
  std::uint32_t subscription_count_;
  events::TypeCatalog catalog_{};
  BroadcastCounter counter_{};
  events::Exchange exchange_;
  std::uint32_t next_ = 0;
  std::int64_t time_ns_ = 0;
};

}  // namespace rtpm::bench::micro
