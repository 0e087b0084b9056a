#include <sys/resource.h>

#include <vector>

#include "cases/case.hpp"
#include "runs/duel.hpp"
#include "runs/run.hpp"
#include "sides/standalone.hpp"

// What it costs a caller, and the server, that so many others are bound who are silent now.
namespace rtpm::bench {
namespace {

constexpr RunPlan kPlan() {
  return {.sample_count = 10'000,
          .warm_up_count = 50,
          .turn_size = 500,
          .rest_part = 0.1,
          .part_count = 5};
}

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

/// The servers, and who is bound to RTPM's.
struct Crowd {
  std::shared_ptr<Duel> duel;
  std::vector<Silent> silent{};

  expected<void, std::string> bind(Carrier carrier, int count) {
    const Running running({&duel->server(Side::kRtpm)});
    for (int i = 0; i < count; ++i) {
      Silent client{.node = make_node(carrier, {.strategy = rt::WaitStrategy::kBlock}),
                    .caller = nullptr};
      auto caller = connect_rtpm_caller(*client.node, duel->rtpm_url(), kHighPriority);
      if (!caller) return unexpected{caller.error()};
      client.caller = std::move(*caller);
      if (auto called = client.caller->echo(); !called) return called;
      silent.push_back(std::move(client));
    }
    return {};
  }
};

expected<void, std::string> measure(const Settings& settings, DuelConfig config, int client_count,
                                    Report& report) {
  // A host gets three quarters of a lane's sessions at most, and here all are of one.
  config.session_count_max = 2 * static_cast<std::uint32_t>(client_count) + 8;
  Run run(settings, kPlan(), report);
  double grown_kib = 0;
  auto measured = run.measure([&]() -> expected<Connect, std::string> {
    auto duel = Duel::start(config);
    if (!duel) return unexpected{duel.error()};
    auto crowd = std::make_shared<Crowd>(Crowd{*duel});
    return Connect([&, crowd]() -> expected<Contenders, std::string> {
      const pid_t server = crowd->duel->server(Side::kRtpm).id();
      const double empty_mib = memory_of(server).resident_mib;
      if (auto bound = crowd->bind(config.carrier, client_count - 1); !bound) {
        return unexpected{bound.error()};
      }
      Contenders contenders;
      for (const Side side : kBothSides) {
        auto contender = crowd->duel->contender(side);
        if (!contender) return unexpected{contender.error()};
        contenders.push_back(std::move(*contender));
      }
      grown_kib = 1024 * (memory_of(server).resident_mib - empty_mib);
      return contenders;
    });
  });
  if (!measured) return measured;
  Json head = head_of("scale", config);
  head["clients"] = client_count;
  run.report(head, {{"per_client_kib", rounded(grown_kib / client_count)}});
  return {};
}

}  // namespace

void run_scale(const Settings& settings, Report& report) {
  allow_many_sockets();
  for (const int client_count : settings.client_counts) {
    measure_each("scale", settings, report, false, [&](const DuelConfig& config) {
      return measure(settings, config, client_count, report);
    });
  }
}

}  // namespace rtpm::bench
