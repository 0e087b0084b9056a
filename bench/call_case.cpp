#include <algorithm>
#include <array>

#include "case.hpp"
#include "disturbance.hpp"
#include "duel.hpp"
#include "rtpm/rt/clock.hpp"

namespace rtpm::bench {
namespace {

constexpr std::uint64_t kSampleCountDefault = 100'000;
/// Calls of one side before the other's turn: short, so that both see the same minutes.
constexpr std::size_t kBlockSize = 500;
/// Untimed calls at the begin of a turn: the first ones meet a server that was stopped.
constexpr int kWarmUpCount = 50;

/// The two sides' connections and what was measured through them.
struct Sides {
  std::array<std::unique_ptr<Caller>, 2> callers;
  std::array<Samples, 2> samples;
};

std::size_t index_of(Side side) {
  return static_cast<std::size_t>(side);
}

expected<void, std::string> connect(Duel& duel, Sides& sides) {
  for (const Side side : kBothSides) {
    duel.take_turn(side);
    auto caller = duel.connect_high();
    if (!caller) return unexpected{caller.error()};
    sides.callers[index_of(side)] = std::move(*caller);
  }
  return {};
}

expected<void, std::string> measure_block(Duel& duel, Side side, Sides& sides, std::size_t count) {
  Caller& caller = *sides.callers[index_of(side)];
  Samples& samples = sides.samples[index_of(side)];
  duel.take_turn(side);
  for (int i = 0; i < kWarmUpCount; ++i) {
    if (auto called = caller.echo(); !called) return called;
  }
  const MonotonicTime begin = rt::now();
  for (std::size_t i = 0; i < count; ++i) {
    const MonotonicTime sent = rt::now();
    if (auto called = caller.echo(); !called) return called;
    samples.add(rt::now() - sent);
  }
  // A tenth of the time belongs to the rest of the system. Without it, real-time throttling would
  // take its share of both CPUs, fifty milliseconds at a time.
  const MonotonicTime end = rt::now();
  duel.end_turn();
  rt::sleep_until(end + (end - begin) / 10);
  return {};
}

expected<void, std::string> measure(Duel& duel, Sides& sides, std::size_t count_per_round) {
  if (auto connected = connect(duel, sides); !connected) return connected;
  bool is_rtpm_first = true;
  for (int round = 0; round < sides.samples[0].round_count(); ++round) {
    for (Samples& samples : sides.samples)
      samples.begin_round(round);
    for (std::size_t done = 0; done < count_per_round; done += kBlockSize) {
      const std::size_t count = std::min(kBlockSize, count_per_round - done);
      for (const Side side : {is_rtpm_first ? Side::kRtpm : Side::kFloor,
                              is_rtpm_first ? Side::kFloor : Side::kRtpm}) {
        if (auto measured = measure_block(duel, side, sides, count); !measured) return measured;
      }
      is_rtpm_first = !is_rtpm_first;
    }
  }
  return {};
}

expected<Result, std::string> measure_one(const Settings& settings, const DuelConfig& config) {
  auto duel = Duel::start(config);
  if (!duel) return unexpected{duel.error()};
  const std::uint64_t count =
      settings.sample_count == 0 ? kSampleCountDefault : settings.sample_count;
  const auto count_per_round = static_cast<std::size_t>(
      std::max<std::uint64_t>(1, count / static_cast<std::uint64_t>(settings.round_count)));
  Sides sides{.callers = {},
              .samples = {Samples(settings.round_count, count_per_round),
                          Samples(settings.round_count, count_per_round)}};
  Result result{.title = title_of("call", config)};
  const auto measured = run_as_caller(config, [&]() -> expected<void, std::string> {
    const DisturbanceWatch watch((*duel)->server_ids());
    if (auto done = measure(**duel, sides, count_per_round); !done) return done;
    add_comparison(result, "call", config, sides.samples[index_of(Side::kRtpm)],
                   sides.samples[index_of(Side::kFloor)]);
    watch.finish(result, longest_us(result));
    return {};
  });
  if (!measured) return unexpected{measured.error()};
  return result;
}

}  // namespace

bool run_call(const Settings& settings, Report& report) {
  return measure_each("call", measure_one, settings, report);
}

}  // namespace rtpm::bench
