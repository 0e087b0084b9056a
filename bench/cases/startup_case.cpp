#include <array>

#include "cases/case.hpp"
#include "figures/disturbance.hpp"
#include "rtpm/rt/clock.hpp"
#include "runs/duel.hpp"
#include "sides/floor.hpp"
#include "sides/standalone.hpp"

// How long it takes from nothing to the first answer: a server's program is started, it says where
// it serves, the caller binds there and calls once. The floor's program opens a socket instead.
namespace rtpm::bench {
namespace {

constexpr std::uint64_t kStartCountDefault = 100;

/// What one side took, start by start.
struct Finding {
  Finding(int round_count, std::size_t count)
      : total(round_count, count),
        ready(round_count, count),
        bind(round_count, count),
        first_call(round_count, count) {}
  void begin_round(int round) {
    for (Samples* samples : {&total, &ready, &bind, &first_call})
      samples->begin_round(round);
  }
  Samples total;
  Samples ready;       ///< Until it said where it serves.
  Samples bind;        ///< Until the caller was bound, or connected.
  Samples first_call;  ///< The call alone.
};

expected<void, std::string> start_once(const Settings& settings, const DuelConfig& config,
                                       Standalone who, Finding& finding) {
  const MonotonicTime begin = rt::now();
  const auto server = start_standalone(who, config.carrier, config.wait.strategy, settings);
  if (!server) return unexpected{server.error()};
  const MonotonicTime ready = rt::now();
  const auto node = who == Standalone::kRtpm ? make_node(config.carrier, config.wait) : nullptr;
  auto caller = who == Standalone::kRtpm
                    ? connect_rtpm_caller(*node, server->address(), kHighPriority)
                    : connect_floor_caller(config.carrier, config.host,
                                           floor_port(server->address()), config.wait);
  if (!caller) return unexpected{caller.error()};
  const MonotonicTime bound = rt::now();
  if (auto called = (*caller)->echo(); !called) return called;
  const MonotonicTime answered = rt::now();
  finding.ready.add(ready - begin);
  finding.bind.add(bound - ready);
  finding.first_call.add(answered - bound);
  finding.total.add(answered - begin);
  return {};
}

expected<Result, std::string> measure_one(const Settings& settings, const DuelConfig& config) {
  const std::size_t per_round = samples_per_round(settings, kStartCountDefault);
  std::array<Finding, 2> findings{Finding(settings.round_count, per_round),
                                  Finding(settings.round_count, per_round)};
  DuelConfig floor_config = config;
  // Raw memory has no address by which another program could find it.
  if (config.carrier == Carrier::kSharedMemory) floor_config.carrier = Carrier::kUdp;
  const DisturbanceWatch watch({});
  for (int round = 0; round < settings.round_count; ++round) {
    for (Finding& finding : findings)
      finding.begin_round(round);
    for (std::size_t i = 0; i < per_round; ++i) {
      const bool is_rtpm_first = (static_cast<std::size_t>(round) + i) % 2 == 0;
      for (const bool is_rtpm : {is_rtpm_first, !is_rtpm_first}) {
        const auto started =
            start_once(settings, is_rtpm ? config : floor_config,
                       is_rtpm ? Standalone::kRtpm : Standalone::kFloor, findings[is_rtpm ? 0 : 1]);
        if (!started) return unexpected{started.error()};
      }
    }
  }
  const auto& [rtpm, floor] = findings;
  Result result{.title = title_of("startup", config)};
  add_comparison(result, "startup", config, rtpm.total, floor.total);
  for (const auto& [name, samples] : {std::pair{"ready_", &rtpm.ready},
                                      {"bind_", &rtpm.bind},
                                      {"first_call_", &rtpm.first_call},
                                      {"floor_ready_", &floor.ready},
                                      {"floor_bind_", &floor.bind},
                                      {"floor_first_call_", &floor.first_call}}) {
    add_distribution(result.json, name, *samples);
  }
  result.rows.push_back({"RTPM, until it serves", rtpm.ready.percentiles()});
  result.rows.push_back({"RTPM, bind", rtpm.bind.percentiles()});
  result.rows.push_back({"RTPM, first call", rtpm.first_call.percentiles()});
  watch.finish(result, longest_us(result));
  return result;
}

}  // namespace

bool run_startup(const Settings& settings, Report& report) {
  return measure_each("startup", measure_one, settings, report);
}

}  // namespace rtpm::bench
