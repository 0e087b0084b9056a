#include <benchmark/benchmark.h>

#include <array>
#include <chrono>
#include <cstdint>
#include <memory>

#include "allocations.hpp"
#include "rtpm/base/histogram.hpp"
#include "rtpm/base/latest.hpp"
#include "rtpm/base/ring.hpp"

namespace rtpm::bench::micro {
namespace {

/// As large as a device's sample, roughly.
struct State {
  std::array<double, 40> values{};
};

void latest_write(benchmark::State& state) {
  Latest<State> latest;
  State value;
  const AllocationCounter allocations(state);
  for (auto _ : state) {
    value.values[0] += 1;
    latest.write(value);
  }
}
BENCHMARK(latest_write);

void latest_read(benchmark::State& state) {
  Latest<State> latest;
  latest.write({});
  const AllocationCounter allocations(state);
  for (auto _ : state) {
    auto value = latest.read();
    benchmark::DoNotOptimize(value);
  }
}
BENCHMARK(latest_read);

void ring_push_and_pop(benchmark::State& state) {
  SpscRing<std::uint64_t, 64> ring;
  std::uint64_t number = 0;
  const AllocationCounter allocations(state);
  for (auto _ : state) {
    bool is_pushed = ring.push(++number);
    benchmark::DoNotOptimize(is_pushed);
    auto popped = ring.pop();
    benchmark::DoNotOptimize(popped);
  }
}
BENCHMARK(ring_push_and_pop);

void histogram_record(benchmark::State& state) {
  const auto histogram = std::make_unique<LatencyHistogram>();
  std::int64_t latency_ns = 1;
  const AllocationCounter allocations(state);
  for (auto _ : state) {
    latency_ns = (latency_ns * 31) % 1'000'003;
    histogram->record(std::chrono::nanoseconds{latency_ns});
  }
  benchmark::DoNotOptimize(*histogram);
}
BENCHMARK(histogram_record);

}  // namespace
}  // namespace rtpm::bench::micro
