#include <sys/resource.h>

#include <algorithm>
#include <array>
#include <vector>

#include "cases/case.hpp"
#include "figures/disturbance.hpp"
#include "rtpm/rt/clock.hpp"
#include "runs/contender.hpp"
#include "runs/duel.hpp"
#include "sides/standalone.hpp"

// What it costs a caller, and the server, that so many others are bound who are silent now.
namespace rtpm::bench {
namespace {

constexpr std::uint64_t kSampleCountDefault = 10'000;
constexpr int kPartCount = 5;  ///< Starts of the servers in a run.
constexpr std::size_t kBlockSize = 500;
constexpr int kWarmUpCount = 50;

/// A silent client: its own node, hence its own session and sockets.
struct Silent {
  std::unique_ptr<rpc::Node> node;
  std::unique_ptr<Caller> caller;
};

/// Each client has a socket of its own, and over TCP the server one for it as well.
void allow_many_sockets() {
  rlimit limit{};
  getrlimit(RLIMIT_NOFILE, &limit);
  limit.rlim_cur = limit.rlim_max;
  setrlimit(RLIMIT_NOFILE, &limit);
}

expected<std::vector<Silent>, std::string> bind_silent(Duel& duel, const DuelConfig& config,
                                                       int count) {
  std::vector<Silent> clients;
  duel.take_turn(Side::kRtpm);
  for (int i = 0; i < count; ++i) {
    Silent client{.node = make_node(config.carrier, {.strategy = rt::WaitStrategy::kBlock}),
                  .caller = nullptr};
    auto caller = duel.connect_by(*client.node);
    if (!caller) return unexpected{caller.error()};
    client.caller = std::move(*caller);
    if (auto called = client.caller->echo(); !called) return unexpected{called.error()};
    clients.push_back(std::move(client));
  }
  return clients;
}

expected<void, std::string> measure_turns(Duel& duel, const DuelConfig& config,
                                          std::array<Samples, 2>& samples, Rounds rounds,
                                          std::size_t count_per_round) {
  std::array<std::unique_ptr<Contender>, 2> contenders;
  for (const Side side : kBothSides) {
    auto contender = connect_contender(duel, side, config, Duration{0});
    if (!contender) return unexpected{contender.error()};
    contenders[static_cast<std::size_t>(side)] = std::move(*contender);
  }
  Samples none(samples[0].round_count(), 0);
  for (int round = rounds.begin; round < rounds.end; ++round) {
    for (Samples& each : samples)
      each.begin_round(round);
    const RoundWatch round_watch = duel.watch_round();
    auto first = static_cast<std::size_t>(round);
    for (std::size_t done = 0; done < count_per_round; done += kBlockSize, ++first) {
      const TurnPlan plan{.warm_up_count = kWarmUpCount,
                          .count = std::min(kBlockSize, count_per_round - done)};
      for (std::size_t i = 0; i < 2; ++i) {
        const std::size_t which = (i + first) % 2;
        const MonotonicTime turn_begin = rt::now();
        auto taken = contenders[which]->take_turn(plan, samples[which], none);
        if (!taken) return taken;
        rt::sleep_until(rt::now() + (rt::now() - turn_begin) / 10);
      }
    }
    const bool was_disturbed = round_watch.was_disturbed();
    for (Samples& each : samples)
      each.note_disturbed(was_disturbed);
  }
  return {};
}

expected<Result, std::string> measure_one(const Settings& settings, const DuelConfig& config,
                                          int client_count) {
  const std::size_t per_round = samples_per_round(settings, kSampleCountDefault);
  std::array<Samples, 2> samples{Samples(settings.round_count, per_round),
                                 Samples(settings.round_count, per_round)};
  DisturbanceWatch watch({});
  double grown_kib = 0;
  for (const Rounds rounds : parts_of_run(settings.round_count, kPartCount)) {
    auto duel = Duel::start(config);
    if (!duel) return unexpected{duel.error()};
    const pid_t server = (*duel)->server_ids().back();
    const MemoryUse empty = memory_of(server);
    auto measured = run_as_caller(config, [&]() -> expected<void, std::string> {
      const auto silent = bind_silent(**duel, config, client_count - 1);
      if (!silent) return unexpected{silent.error()};
      watch.follow((*duel)->server_ids());
      auto done = measure_turns(**duel, config, samples, rounds, per_round);
      grown_kib = 1024 * (memory_of(server).resident_mib - empty.resident_mib);
      watch.note();
      return done;
    });
    if (!measured) return unexpected{measured.error()};
  }
  Result result{.title = title_of("scale", config) + ", " + std::to_string(client_count) +
                         (client_count == 1 ? " bound client" : " bound clients")};
  add_comparison(result, "scale", config, samples[0], samples[1]);
  result.json.add("clients", client_count);
  result.json.add("per_client_kib", grown_kib / client_count);
  result.notes.push_back("the server's memory grew by " + short_text(grown_kib / client_count) +
                         " KiB for each client");
  watch.finish(result, longest_us(result));
  return result;
}

}  // namespace

bool run_scale(const Settings& settings, Report& report) {
  allow_many_sockets();
  bool is_complete = true;
  for (const int client_count : settings.client_counts) {
    for (const Carrier carrier : settings.carriers) {
      for (const rt::WaitStrategy strategy : settings.waits) {
        // A host gets three quarters of a lane's sessions at most, and here all are of one.
        const DuelConfig config{
            .carrier = carrier,
            .wait = {.strategy = strategy, .spin = settings.spin},
            .session_count_max = 2 * static_cast<std::uint32_t>(client_count) + 8,
            .placement = choose_placement(),
            .realtime = settings.realtime};
        const auto result = measure_one(settings, config, client_count);
        if (result) {
          report.add(*result);
        } else {
          say_not_measured(
              title_of("scale", config) + ", " + std::to_string(client_count) + " bound clients",
              result.error());
          is_complete = false;
        }
      }
    }
  }
  return is_complete;
}

}  // namespace rtpm::bench
