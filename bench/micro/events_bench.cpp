#include <benchmark/benchmark.h>

#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include "rtpm/events/catalog.hpp"
#include "rtpm/events/exchange.hpp"

// What an event costs the hub's core: 10 000 subscriptions of 100 types, so that 100 want each
// event, and as a comparison with 100 of one type, which should cost the same.
namespace rtpm::bench {
namespace {

using namespace rtpm::events;

constexpr std::uint64_t kSchema = 7;
constexpr std::array kFields{FieldDescriptor{"x", ScalarType::kDouble, {.offset = 0}}};

/// Counts what is broadcast, as shared memory would be written once.
class Counter final : public Broadcaster {
 public:
  void broadcast(std::span<const SubscriptionNumber> to,
                 std::span<const EventRef>) noexcept override {
    count += to.size();
  }
  std::uint64_t count = 0;
};

struct Crowd {
  template <class MakeFilter>
  Crowd(std::uint32_t type_count, std::uint32_t count, bool is_broadcast, MakeFilter make_filter)
      : exchange({.subscription_count_max = count, .interest_count_max = count}, &counter) {
    for (std::uint32_t type = 1; type <= type_count; ++type) {
      const auto added = catalog.add({type, "Sample", kSchema, kFields});
      benchmark::DoNotOptimize(added);
    }
    for (std::uint32_t i = 0; i < count; ++i) {
      auto prepared = Exchange::prepare(make_filter(1 + i % type_count), {.queue_capacity = 1},
                                        catalog, is_broadcast);
      subscribed += exchange.subscribe(std::move(*prepared), {}) ? 1U : 0U;
    }
  }
  TypeCatalog catalog{};
  Counter counter{};
  Exchange exchange;
  std::uint32_t subscribed = 0;
};

/// Offers events of all types in turn.
void offer(benchmark::State& state, Crowd& crowd, std::uint32_t type_count) {
  const std::array<double, 4> payload{1, 2, 3, 4};
  std::uint32_t next = 0;
  std::int64_t time_ns = 0;
  for (auto _ : state) {
    const EventHeader header{.type = 1 + next++ % type_count, .schema_id = kSchema};
    auto taken = crowd.exchange.offer({header, std::as_bytes(std::span(payload))},
                                      time_from_ns(time_ns += 1'000'000));
    benchmark::DoNotOptimize(taken);
  }
  state.counters["subscriptions"] = crowd.subscribed;
}

Filter by_type(std::uint32_t type) {
  return of_type(type);
}
Filter by_value(std::uint32_t type) {
  return all_of({of_type(type), where(type, "x", Comparison::kGreater, Scalar::of(2.0))});
}

void events_match(benchmark::State& state) {
  const auto type_count = static_cast<std::uint32_t>(state.range(0));
  const auto crowd = std::make_unique<Crowd>(type_count, type_count * 100, true, by_type);
  offer(state, *crowd, type_count);
}
BENCHMARK(events_match)->Arg(1)->Arg(100);

/// A predicate that rejects: all programs run.
void events_match_by_field(benchmark::State& state) {
  const auto type_count = static_cast<std::uint32_t>(state.range(0));
  const auto crowd = std::make_unique<Crowd>(type_count, type_count * 100, true, by_value);
  offer(state, *crowd, type_count);
}
BENCHMARK(events_match_by_field)->Arg(1)->Arg(100);

/// Matched, and queued for each of the 100 with the oldest dropped.
void events_queue(benchmark::State& state) {
  const auto type_count = static_cast<std::uint32_t>(state.range(0));
  const auto crowd = std::make_unique<Crowd>(type_count, type_count * 100, false, by_type);
  offer(state, *crowd, type_count);
}
BENCHMARK(events_queue)->Arg(1)->Arg(100);

}  // namespace
}  // namespace rtpm::bench
