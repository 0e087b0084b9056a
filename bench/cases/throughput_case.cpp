#include <algorithm>
#include <vector>

#include "cases/case.hpp"
#include "figures/disturbance.hpp"
#include "rtpm/rt/clock.hpp"

// How many calls a second one thread gets through one lane when it does not wait for each.
namespace rtpm::bench {
namespace {

constexpr std::uint64_t kCallCountDefault = 500'000;
constexpr std::uint64_t kBlockSize = 20'000;

/// The rates of one side, round by round.
struct Rates {
  const ServerProcess* server = nullptr;
  Pipeline pipeline{};
  std::vector<double> rounds{};

  Outcome<> measure(std::uint64_t count) {
    Duration took{0};
    {
      const Running running({server});
      if (auto warm = pipeline(count / 10 + 1); !warm) return warm;
      const MonotonicTime begin = rt::now();
      if (auto run = pipeline(count); !run) return run;
      took = rt::now() - begin;
    }
    rounds.push_back(
        rounded(static_cast<double>(count) / std::chrono::duration<double>(took).count()));
    // The rest of the system gets a tenth of the time, see calls_case.cpp.
    rt::sleep_until(rt::now() + took / 10);
    return {};
  }
};

/// Measures RTPM's rates, and those of the raw floor, which has a pipeline over UDP.
Outcome<std::vector<Rates>> measure(const Settings& settings, const DuelConfig& config,
                                    Duel& duel) {
  std::vector<Rates> sides;
  for (const Side side : kBothSides) {
    if (side == Side::kFloor && config.carrier != Carrier::kUdp) continue;
    const Running running({&duel.server(side)});
    auto pipeline = duel.connect_pipeline(side);
    if (!pipeline) return failure(pipeline.error());
    sides.push_back({.server = &duel.server(side), .pipeline = std::move(*pipeline)});
  }
  const std::uint64_t count =
      settings.sample_count == 0 ? kCallCountDefault : settings.sample_count;
  for (std::uint64_t done = 0; done < count; done += kBlockSize) {
    for (Rates& side : sides) {
      if (auto measured = side.measure(std::min(kBlockSize, count - done)); !measured) {
        return failure(measured.error());
      }
    }
  }
  return sides;
}

}  // namespace

Outcome<> measure_throughput(const Settings& settings, const DuelConfig& config, Report& report) {
  auto duel = Duel::start(config);
  if (!duel) return failure(duel.error());
  return run_as_caller(settings, [&]() -> Outcome<> {
    const CpuTime before = read_cpu_time();
    const auto sides = measure(settings, config, **duel);
    if (!sides) return failure(sides.error());
    const std::vector<double>& rounds = sides->front().rounds;
    Json result = head_of("throughput", config);
    result["in_flight"] = kInFlight;
    result["calls_per_second"] = rounded(middle_of(rounds));
    result["calls_per_second_low"] = *std::ranges::min_element(rounds);
    result["calls_per_second_high"] = *std::ranges::max_element(rounds);
    result["rounds_calls_per_second"] = rounds;
    if (sides->size() > 1) {
      const std::vector<double>& of_floor = sides->back().rounds;
      result["floor_calls_per_second"] = rounded(middle_of(of_floor));
      result["floor_rounds_calls_per_second"] = of_floor;
      result["ratio"] = rounded(middle_of(rounds) / middle_of(of_floor));
    }
    add_steal(result, before);
    report.add(std::move(result));
    return {};
  });
}

}  // namespace rtpm::bench
