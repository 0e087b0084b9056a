#include <benchmark/benchmark.h>

#include <array>
#include <cstdint>
#include <cstdlib>
#include <memory>

#include "allocations.hpp"
#include "broadcast/ring.hpp"
#include "event_crowd.hpp"

// What an event costs the hub's core: 10 000 subscriptions of 100 types, so that 100 want each
// event, and as a comparison with 100 of one type, which should cost the same.
namespace rtpm::bench::micro {
namespace {

/// Offers events of all types in turn.
void offer(benchmark::State& state, bool is_broadcast, events::Filter (*filter)(std::uint32_t)) {
  const auto crowd =
      std::make_unique<Crowd>(static_cast<std::uint32_t>(state.range(0)), is_broadcast, filter);
  {
    const AllocationCounter allocations(state);
    for (auto _ : state) {
      bool is_taken = crowd->offer();
      benchmark::DoNotOptimize(is_taken);
    }
  }
  state.counters["subscriptions"] = crowd->subscription_count();
}

void events_match(benchmark::State& state) {
  offer(state, true, by_type);
}
BENCHMARK(events_match)->Arg(1)->Arg(100);

/// A predicate that rejects: all programs run.
void events_match_by_field(benchmark::State& state) {
  offer(state, true, by_value);
}
BENCHMARK(events_match_by_field)->Arg(1)->Arg(100);

/// Matched, and queued for each of the 100 with the oldest dropped.
void events_queue(benchmark::State& state) {
  offer(state, false, by_type);
}
BENCHMARK(events_queue)->Arg(1)->Arg(100);

/// The ring between the hub and consumers of its host: one record of 96 bytes written for 64 of
/// them, and read by one.
void event_ring_write_and_read(benchmark::State& state) {
  const std::size_t size = events::ring_memory_size(events::kRingSizeMin);
  std::byte* const memory = static_cast<std::byte*>(std::aligned_alloc(4096, size));
  std::memset(memory, 0, size);
  events::RingWriter writer({memory, size}, 1);
  events::SlotSet places;
  for (std::uint32_t place = 0; place < 64; ++place) {
    writer.begin_slot(place, 1 + place);
    places.add(place);
  }
  events::RingReader reader({memory, size}, 0, 1, writer.position());
  const std::array<std::byte, 96> event{};
  {
    const AllocationCounter allocations(state);
    for (auto _ : state) {
      if (!writer.write(places, event, 1) || reader.read() != events::RingRead::kEvents) {
        state.SkipWithError("the ring does not give back what was written");
        break;
      }
      reader.count_read(1);
    }
  }
  std::free(memory);
}
BENCHMARK(event_ring_write_and_read);

}  // namespace
}  // namespace rtpm::bench::micro
