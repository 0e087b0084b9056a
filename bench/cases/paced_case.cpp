#include <algorithm>
#include <array>

#include "cases/case.hpp"
#include "cases/peers_case.hpp"
#include "figures/disturbance.hpp"
#include "rtpm/rt/clock.hpp"
#include "runs/duel.hpp"
#include "runs/paced_calls.hpp"

namespace rtpm::bench {
namespace {

constexpr std::uint64_t kSampleCountDefault = 10'000;
/// How long one side calls before the other's turn, at most: the share of it in which a server that
/// was stopped learns a caller's rhythm anew is to be small.
constexpr double kTurnS = 0.5;
constexpr double kFullTurnS = 0.25;  ///< At least, if there are samples for two of them.
constexpr int kWarmUpCount = 5;

struct Contender {
  Side side;
  std::unique_ptr<Caller> caller;
  Samples samples;
};
using Contenders = std::array<Contender, 2>;

/// What RTPM's server took of its CPU while it served.
struct ServerLoad {
  Duration cpu_time{0};
  Duration time{0};
  [[nodiscard]] double percent() const {
    return time == Duration{0}
               ? 0
               : 100.0 * static_cast<double>(cpu_time.count()) / static_cast<double>(time.count());
  }
};

expected<void, std::string> measure_turn(Duel& duel, Contender& contender, Duration period,
                                         std::size_t count, bool is_spun, ServerLoad& load) {
  duel.take_turn(contender.side);
  if (!contender.caller) {
    auto caller = duel.connect_high();
    if (!caller) return unexpected{caller.error()};
    contender.caller = std::move(*caller);
  }
  for (int i = 0; i < kWarmUpCount; ++i) {
    if (auto called = contender.caller->echo(); !called) return called;
  }
  const MonotonicTime begin = rt::now();
  const Duration cpu_before = duel.rtpm_server_cpu_time();
  auto called = call_paced(*contender.caller, period, count, CountFrom::kDue, contender.samples);
  if (contender.side == Side::kRtpm) {
    load.cpu_time += duel.rtpm_server_cpu_time() - cpu_before;
    load.time += rt::now() - begin;
  }
  // The floor spins where RTPM waits for a rhythm, too.
  if (is_spun) duel.rest_after(period * static_cast<Duration::rep>(count));
  return called;
}

expected<void, std::string> measure(Duel& duel, Contenders& contenders, double rate_hz,
                                    std::size_t count_per_round, bool is_spun, ServerLoad& load) {
  const Duration period{static_cast<Duration::rep>(1e9 / rate_hz)};
  const auto turn_size = std::max<std::size_t>(1, static_cast<std::size_t>(kTurnS * rate_hz));
  for (int round = 0; round < contenders[0].samples.round_count(); ++round) {
    for (Contender& contender : contenders)
      contender.samples.begin_round(round);
    const RoundWatch round_watch = duel.watch_round();
    for (std::size_t done = 0; done < count_per_round; done += turn_size) {
      const std::size_t count = std::min(turn_size, count_per_round - done);
      for (Contender& contender : contenders) {
        if (auto measured = measure_turn(duel, contender, period, count, is_spun, load);
            !measured) {
          return measured;
        }
      }
      std::swap(contenders[0], contenders[1]);
    }
    duel.end_turn();
    const bool was_disturbed = round_watch.was_disturbed();
    for (Contender& contender : contenders)
      contender.samples.note_disturbed(was_disturbed);
  }
  return {};
}

/// Few samples make few rounds: a server that was stopped learns a caller's rhythm anew in each.
int round_count_of(const Settings& settings, std::uint64_t sample_count) {
  const auto full_turn = static_cast<std::uint64_t>(kFullTurnS * settings.rate_hz);
  if (full_turn == 0 || sample_count < 2 * full_turn) return settings.round_count;
  return std::min(settings.round_count, static_cast<int>(sample_count / full_turn));
}

expected<Result, std::string> measure_one(const Settings& settings, const DuelConfig& config) {
  auto duel = Duel::start(config);
  if (!duel) return unexpected{duel.error()};
  const std::uint64_t count =
      settings.sample_count == 0 ? kSampleCountDefault : settings.sample_count;
  const int round_count = round_count_of(settings, count);
  const auto count_per_round = static_cast<std::size_t>(
      std::max<std::uint64_t>(1, count / static_cast<std::uint64_t>(round_count)));
  Contenders contenders{Contender{Side::kRtpm, nullptr, Samples(round_count, count_per_round)},
                        Contender{Side::kFloor, nullptr, Samples(round_count, count_per_round)}};
  Result result{.title = title_of("paced", config) + ", " + short_text(settings.rate_hz) + " Hz"};
  ServerLoad load;
  const bool is_spun = config.wait.strategy == rt::WaitStrategy::kSpin ||
                       config.wait.strategy == rt::WaitStrategy::kPeriodic;
  const auto measured = run_as_caller(config, [&]() -> expected<void, std::string> {
    const DisturbanceWatch watch((*duel)->server_ids());
    if (auto done = measure(**duel, contenders, settings.rate_hz, count_per_round, is_spun, load);
        !done) {
      return done;
    }
    const bool is_swapped = contenders[0].side == Side::kFloor;
    add_comparison(result, "paced", config, contenders[is_swapped ? 1 : 0].samples,
                   contenders[is_swapped ? 0 : 1].samples);
    result.json.add("rate_hz", settings.rate_hz);
    result.json.add("server_cpu_percent", load.percent());
    result.notes.push_back("RTPM's server took " + short_text(load.percent()) + " % of its CPU");
    watch.finish(result, longest_us(result));
    return {};
  });
  if (!measured) return unexpected{measured.error()};
  return result;
}

}  // namespace

bool run_paced(const Settings& settings, Report& report) {
  if (!settings.peers.empty()) return run_paced_with_peers(settings, report);
  return measure_each("paced", measure_one, settings, report);
}

}  // namespace rtpm::bench
