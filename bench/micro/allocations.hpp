#pragma once

#include <benchmark/benchmark.h>

#include <cstdint>

namespace rtpm::bench::micro {

/// How often this program has allocated so far, on whatever thread.
[[nodiscard]] std::uint64_t allocation_count() noexcept;

/// Tells a benchmark's `allocations`: how many its whole timed loop made, whatever its length. What
/// is to allocate nothing shows 0. Make it right before the loop.
class AllocationCounter {
 public:
  explicit AllocationCounter(benchmark::State& state) noexcept
      : state_(state), before_(allocation_count()) {}
  ~AllocationCounter() {
    // Taken before the counter's own entry in a map, which allocates.
    const auto count = static_cast<double>(allocation_count() - before_);
    state_.counters["allocations"] = count;
  }
  AllocationCounter(const AllocationCounter&) = delete;
  AllocationCounter& operator=(const AllocationCounter&) = delete;

 private:
  benchmark::State& state_;
  std::uint64_t before_;
};

}  // namespace rtpm::bench::micro
