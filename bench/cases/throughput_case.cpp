#include <algorithm>
#include <array>
#include <vector>

#include "cases/case.hpp"
#include "figures/disturbance.hpp"
#include "rtpm/rt/clock.hpp"
#include "runs/duel.hpp"

// How many calls a second one thread gets through one lane when it does not wait for each.
namespace rtpm::bench {
namespace {

constexpr std::uint64_t kCallCountDefault = 500'000;
constexpr std::uint64_t kBlockSize = 20'000;

struct Rates {
  std::vector<double> rtpm;
  std::vector<double> floor;
};

expected<double, std::string> rate_of(Duel& duel, Side side, Pipeline& pipeline,
                                      std::uint64_t count) {
  duel.take_turn(side);
  if (auto warm = pipeline.run(count / 10 + 1); !warm) return unexpected{warm.error()};
  const MonotonicTime begin = rt::now();
  if (auto run = pipeline.run(count); !run) return unexpected{run.error()};
  const MonotonicTime end = rt::now();
  duel.end_turn();
  // A tenth of the time belongs to the rest of the system, see call_case.cpp.
  rt::sleep_until(end + (end - begin) / 10);
  return static_cast<double>(count) / std::chrono::duration<double>(end - begin).count();
}

expected<Rates, std::string> measure(Duel& duel, const Settings& settings, bool has_floor) {
  const std::uint64_t count =
      settings.sample_count == 0 ? kCallCountDefault : settings.sample_count;
  Rates rates;
  duel.take_turn(Side::kRtpm);
  auto rtpm = duel.connect_pipeline(settings.in_flight);
  if (!rtpm) return unexpected{rtpm.error()};
  std::unique_ptr<Pipeline> floor;
  if (has_floor) {
    duel.take_turn(Side::kFloor);
    auto connected = duel.connect_pipeline(settings.in_flight);
    if (!connected) return unexpected{connected.error()};
    floor = std::move(*connected);
  }
  for (std::uint64_t done = 0; done < count; done += kBlockSize) {
    const std::uint64_t block = std::min(kBlockSize, count - done);
    const auto rate = rate_of(duel, Side::kRtpm, **rtpm, block);
    if (!rate) return unexpected{rate.error()};
    rates.rtpm.push_back(*rate);
    if (!floor) continue;
    const auto floor_rate = rate_of(duel, Side::kFloor, *floor, block);
    if (!floor_rate) return unexpected{floor_rate.error()};
    rates.floor.push_back(*floor_rate);
  }
  return rates;
}

expected<Result, std::string> measure_one(const Settings& settings, const DuelConfig& config) {
  auto duel = Duel::start(config);
  if (!duel) return unexpected{duel.error()};
  const bool has_floor = config.carrier == Carrier::kUdp;
  Result result{.title = title_of("throughput", config)};
  const auto measured = run_as_caller(config, [&]() -> expected<void, std::string> {
    const DisturbanceWatch watch((*duel)->server_ids());
    const auto rates = measure(**duel, settings, has_floor);
    if (!rates) return unexpected{rates.error()};
    const double rtpm = middle_of(rates->rtpm);
    result.json.add("case", "throughput");
    result.json.add("transport", to_string(config.carrier));
    result.json.add("wait", rt::to_string(config.wait.strategy));
    result.json.add("payload", static_cast<std::int64_t>(kPayloadSize));
    result.json.add("in_flight", static_cast<std::int64_t>(settings.in_flight));
    result.json.add("calls_per_second", rtpm);
    result.json.add("calls_per_second_low", *std::ranges::min_element(rates->rtpm));
    result.json.add("calls_per_second_high", *std::ranges::max_element(rates->rtpm));
    result.json.add("rounds_calls_per_second", rates->rtpm);
    result.notes.push_back("RTPM makes " + short_text(rtpm / 1000) + " thousand calls a second, " +
                           std::to_string(settings.in_flight) + " at a time.");
    if (has_floor) {
      const double floor = middle_of(rates->floor);
      result.json.add("floor_calls_per_second", floor);
      result.json.add("floor_rounds_calls_per_second", rates->floor);
      result.json.add("ratio", rtpm / floor);
      result.notes.push_back("The raw socket makes " + short_text(floor / 1000) +
                             " thousand: RTPM's are " + short_text(rtpm / floor) + " of these.");
    }
    watch.finish(result, 0);
    return {};
  });
  if (!measured) return unexpected{measured.error()};
  return result;
}

}  // namespace

bool run_throughput(const Settings& settings, Report& report) {
  return measure_each("throughput", measure_one, settings, report);
}

}  // namespace rtpm::bench
