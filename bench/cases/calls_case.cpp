#include <sys/resource.h>

#include <algorithm>
#include <array>
#include <optional>
#include <vector>

#include "cases/case.hpp"
#include "sides/hello_storm.hpp"
#include "sides/network_pair.hpp"
#include "sides/standalone.hpp"

// Calls beside the raw floor and, where asked for, beside peers: one after the other, at a pace, at
// a pace beside callers of low priority, between two hosts, and beside many silent clients.
namespace rtpm::bench {
namespace {

/// Call counts by payload size: how many are worth their time, and how many one side makes before
/// the other's turn. A turn is short enough that both sides see the same minutes, and that none
/// fills a second, after which the kernel throttles real-time threads. RTPM's threads avoid that
/// throttling, the floor's do not: so each turn is followed by a pause.
struct Amount {
  std::size_t payload_size_max;
  std::uint64_t sample_count;
  std::uint64_t turn_size;
  std::uint64_t warm_up_count;
};
constexpr std::array<Amount, 3> kAmounts{{{std::size_t{16} * 1024, 100'000, 500, 50},
                                          {std::size_t{256} * 1024, 10'000, 100, 10},
                                          {SIZE_MAX, 1'000, 20, 2}}};

/// How long a call of low priority computes.
constexpr Duration kLowWork = std::chrono::microseconds{200};

void invite_peers(const Settings& settings, const DuelConfig& config, Run& run) {
  if (settings.peers.empty()) return;
  run.invite(chosen_peers(settings), "call", config.carrier,
             {.placement = config.placement,
              .realtime = config.realtime,
              .low_caller_count = config.low_caller_count,
              .work_ns = config.low_work.count()});
}

/// Returns the floors to compare a carrier with: its own raw floor (nullopt means the same
/// carrier), and for shared memory also two raw sockets, as a program without RTPM would use for
/// two priorities.
std::vector<std::optional<Carrier>> floors_beside(const Settings& settings, Carrier carrier) {
  if (carrier != Carrier::kSharedMemory || !settings.peers.empty()) return {std::nullopt};
  return {Carrier::kUdp, std::nullopt};
}

/// A paced loop, alone and under each load.
RunPlan loaded_plan(const Settings& settings, std::uint64_t sample_count, double turn_s,
                    std::vector<int> loads, std::string load_field) {
  return {.sample_count = sample_count,
          .warm_up_count = 20,
          .turn_size = settings.paced_count(turn_s),
          .is_round_a_turn = true,
          .rest_part = 0.15,
          .rate_hz = settings.rate_hz,
          .loads = std::move(loads),
          .load_field = std::move(load_field)};
}

/// A loop at the requested rate, alone and while 1000 HELLOs a second arrive.
Outcome<> measure_hello_storm(const Settings& settings, DuelConfig config, Report& report) {
  config.has_hello_storm = true;
  Run run(settings, loaded_plan(settings, 60'000, 0.2, {0, 1}, "hello_storms"), report);
  if (auto measured = run.measure(start_duel(config)); !measured) return measured;
  Json head = head_of("isolation", config);
  head["hellos_per_second"] = kHellosPerSecond;
  run.report(head);
  return {};
}

Outcome<> bind_silent(const Duel& duel, Carrier carrier, int count, std::vector<Client>& silent) {
  const Running running({&duel.server(Side::kRtpm)});
  for (int i = 0; i < count; ++i) {
    auto client = bind_client(carrier, {.strategy = rt::WaitStrategy::kBlock}, duel.rtpm_url());
    if (!client) return failure(client.error());
    silent.push_back(std::move(*client));
  }
  return {};
}

Outcome<> measure_beside(const Settings& settings, DuelConfig config, int client_count,
                         Report& report) {
  // One host gets at most three quarters of a lane's sessions, and here all clients share a host.
  config.session_count_max = 2 * static_cast<std::uint32_t>(client_count) + 8;
  Run run(settings,
          {.sample_count = 10'000,
           .warm_up_count = 50,
           .turn_size = 500,
           .rest_part = 0.1,
           .part_count = 5},
          report);
  std::vector<Client> silent;
  double grown_kib = 0;
  auto measured = run.measure(start_duel(config, [&](const auto& duel) -> Outcome<Contenders> {
    const pid_t server = duel->server(Side::kRtpm).id();
    const double empty_mib = resident_mib_of(server);
    silent.clear();
    auto bound = bind_silent(*duel, config.carrier, client_count - 1, silent);
    grown_kib = 1024 * (resident_mib_of(server) - empty_mib);
    if (!bound) return failure(bound.error());
    return duel->contenders();
  }));
  if (!measured) return measured;
  Json head = head_of("scale", config);
  head["clients"] = client_count;
  run.report(head, {{"per_client_kib", rounded(grown_kib / client_count)}});
  return {};
}

}  // namespace

Outcome<> measure_calls(const Settings& settings, const DuelConfig& sides, Report& report) {
  const bool has_peers = !settings.peers.empty();
  DuelConfig config = sides;
  for (const std::size_t payload_size : settings.payload_sizes) {
    // Peers know one payload.
    if (!has_peers) config.payload_size = payload_size;
    const Amount& amount = *std::ranges::find_if(
        kAmounts, [&](const Amount& each) { return config.payload_size <= each.payload_size_max; });
    Run run(settings,
            {.sample_count = amount.sample_count,
             .warm_up_count = amount.warm_up_count,
             .turn_size = amount.turn_size,
             .rest_part = 0.1,
             .part_count = has_peers ? 5 : 20},
            report);
    invite_peers(settings, config, run);
    if (auto measured = run.measure(start_duel(config)); !measured) return measured;
    run.report(head_of("call", config));
  }
  return {};
}

Outcome<> measure_paced(const Settings& settings, const DuelConfig& config, Report& report) {
  // The floor spins where RTPM predicts the caller's period, too.
  const bool is_spun = config.wait.strategy == rt::WaitStrategy::kSpin ||
                       config.wait.strategy == rt::WaitStrategy::kPeriodic;
  // A server that was stopped has to estimate a caller's period anew in each turn.
  Run run(settings,
          {.sample_count = 10'000,
           .warm_up_count = 5,
           .turn_size = settings.paced_count(0.25),
           .is_round_a_turn = true,
           .rest_part = is_spun ? 0.15 : 0,
           .rate_hz = settings.rate_hz,
           .count_from = CountFrom::kDue},
          report);
  invite_peers(settings, config, run);
  std::shared_ptr<Duel> kept;
  auto measured = run.measure(start_duel(config, [&](const auto& duel) {
    kept = duel;
    return duel->contenders();
  }));
  if (!measured || kept == nullptr) return measured;
  // The server runs only in its own turns.
  const std::chrono::duration<double> cpu_time = cpu_time_of(kept->server(Side::kRtpm).id());
  run.report(head_of("paced", config),
             {{"server_cpu_percent", rounded(100 * cpu_time.count() / run.paced_seconds())}});
  return {};
}

Outcome<> measure_isolation(const Settings& settings, const DuelConfig& sides, Report& report) {
  if (settings.is_sealed) return measure_hello_storm(settings, sides, report);
  const std::vector<int>& loads = settings.low_caller_counts;
  DuelConfig config = sides;
  config.low_caller_count = *std::ranges::max_element(loads);
  config.low_work = kLowWork;
  for (const std::optional<Carrier> floor : floors_beside(settings, config.carrier)) {
    config.floor_carrier = floor;
    // Per load, or over all loads if they are few: a p99.9 needs many samples.
    const auto count = std::max<std::uint64_t>(10'000, 30'000 / loads.size());
    Run run(settings,
            loaded_plan(settings, count, settings.peers.empty() ? 0.05 : 0.1, loads, "low_callers"),
            report);
    invite_peers(settings, config, run);
    if (auto measured = run.measure(start_duel(config)); !measured) return measured;
    Json head = head_of("isolation", config);
    head["work_us"] = std::chrono::duration<double, std::micro>(kLowWork).count();
    run.report(head);
  }
  return {};
}

Outcome<> measure_two_node(const Settings& settings, const DuelConfig& sides, Report& report) {
  if (sides.carrier == Carrier::kSharedMemory) {
    if (settings.carriers.size() > 1) return {};
    return failure("only UDP and TCP run between two hosts; add --transport udp");
  }
  const auto network = NetworkPair::create();
  if (!network) return failure(network.error());
  DuelConfig config = sides;
  config.host = NetworkPair::kServerAddress;
  config.enter_server_host = [&] { return network->enter(NetworkPair::Host::kServer); };
  Run run(settings,
          {.sample_count = 10'000, .warm_up_count = 50, .turn_size = 500, .rest_part = 0.1},
          report);
  auto measured = run.measure(start_duel(config, [&](const auto& duel) -> Outcome<Contenders> {
    // Only this thread enters the client's host, and with it the sockets that it opens.
    const auto entered = network->enter(NetworkPair::Host::kClient);
    if (!entered) return failure(entered.error());
    return duel->contenders();
  }));
  if (measured) run.report(head_of("two-node", config));
  return measured;
}

// The cost, to a caller and to the server, of many other bound clients that are silent.
Outcome<> measure_scale(const Settings& settings, const DuelConfig& config, Report& report) {
  // Each client has a socket of its own, and over TCP the server has one for each client as well.
  rlimit limit{};
  getrlimit(RLIMIT_NOFILE, &limit);
  limit.rlim_cur = limit.rlim_max;
  setrlimit(RLIMIT_NOFILE, &limit);
  for (const int client_count : settings.client_counts) {
    if (auto measured = measure_beside(settings, config, client_count, report); !measured) {
      return failure(std::to_string(client_count) + " clients: " + measured.error());
    }
  }
  return {};
}

}  // namespace rtpm::bench
