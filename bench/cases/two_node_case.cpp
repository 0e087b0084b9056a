#include <algorithm>
#include <map>

#include "cases/case.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/wire/url.hpp"
#include "runs/duel.hpp"
#include "runs/run.hpp"
#include "sides/network_pair.hpp"

namespace rtpm::bench {
namespace {

constexpr std::uint64_t kTurnSize = 500;
constexpr std::uint64_t kWarmUpCount = 50;

/// The outcomes of RTPM's calls.
struct Outcomes {
  std::uint64_t call_count = 0;
  std::uint64_t answered_count = 0;
  std::map<std::string_view, std::uint64_t> failures{};  ///< Counts by the error's name.
  std::uint64_t repeat_count = 0;
  std::uint64_t next_number = 0;  ///< Also counts the warm-up's calls: they, too, might run twice.
  NumberedRuns runs{};            ///< The server's record.
};

/// Makes calls whose numbers show which of them ran, and that may fail.
class NumberedContender final : public Contender {
 public:
  NumberedContender(const ServerProcess& server, const Settings& settings, bool is_tcp,
                    std::unique_ptr<NumberedCaller> caller, Outcomes& outcomes)
      : server_(server),
        settings_(settings),
        is_tcp_(is_tcp),
        caller_(std::move(caller)),
        outcomes_(outcomes) {}

  expected<void, std::string> take_turn(const TurnPlan& plan, Finding& finding) override {
    const Running running({&server_});
    for (std::uint64_t i = 0; i < plan.warm_up_count; ++i)
      (void)caller_->call(outcomes_.next_number++, settings_.deadline);
    const std::uint64_t sent_before = sent_count();
    for (std::uint64_t i = 0; i < plan.count; ++i) {
      const MonotonicTime sent = rt::now();
      const auto called = caller_->call(outcomes_.next_number++, settings_.deadline);
      // A failed call costs its caller time like any other.
      finding.first.add(rt::now() - sent);
      ++(called ? outcomes_.answered_count : outcomes_.failures[rpc::to_string(called.error())]);
    }
    outcomes_.call_count += plan.count;
    const std::uint64_t sent = sent_count() - sent_before;
    outcomes_.repeat_count += is_tcp_ ? sent : sent - std::min(sent, plan.count);
    const auto runs = caller_->runs();
    if (!runs) {
      return unexpected{"the server does not tell what ran: " +
                        std::string(rpc::to_string(runs.error()))};
    }
    outcomes_.runs = *runs;
    return {};
  }

 private:
  /// The datagrams (UDP) or repeated segments (TCP) that the client's host has sent so far.
  [[nodiscard]] std::uint64_t sent_count() const {
    return is_tcp_ ? network_counter("Tcp", "RetransSegs") : network_counter("Udp", "OutDatagrams");
  }

  const ServerProcess& server_;
  const Settings& settings_;
  bool is_tcp_;
  std::unique_ptr<NumberedCaller> caller_;
  Outcomes& outcomes_;
};

expected<Contenders, std::string> connect(Duel& duel, const Settings& settings,
                                          const DuelConfig& config, const NetworkPair& network,
                                          Outcomes& outcomes) {
  // Only this thread enters the client's host, and with it the sockets that it opens.
  auto entered = network.enter(NetworkPair::Host::kClient);
  if (entered && settings.drop_percent > 0) {
    entered =
        network.drop(config.carrier, wire::parse_url(duel.rtpm_url())->port, settings.drop_percent);
  }
  if (!entered) return unexpected{entered.error()};
  const ServerProcess& server = duel.server(Side::kRtpm);
  const Running running({&server});
  auto numbered = connect_numbered_caller(duel.high_node(), duel.rtpm_url(), kHighPriority);
  if (!numbered) return unexpected{numbered.error()};
  Contenders contenders;
  contenders.push_back(std::make_unique<NumberedContender>(
      server, settings, config.carrier == Carrier::kTcp, std::move(*numbered), outcomes));
  auto floor = duel.contender(Side::kFloor);
  if (!floor) return unexpected{floor.error()};
  contenders.push_back(std::move(*floor));
  return contenders;
}

Json tell(const Outcomes& outcomes, std::uint64_t dropped_count) {
  Json failed = Json::object();
  for (const auto& [error, count] : outcomes.failures)
    failed[std::string(error)] = count;
  return {{"calls", outcomes.call_count},
          {"succeeded", outcomes.answered_count},
          {"failed", failed},
          {"numbers_sent", outcomes.next_number},
          {"numbers_run", outcomes.runs.distinct_count},
          {"run_twice", outcomes.runs.again_count},
          {"repeats", outcomes.repeat_count},
          {"dropped", dropped_count}};
}

expected<void, std::string> measure(const Settings& asked, const DuelConfig& sides,
                                    Report& report) {
  Settings settings = asked;
  DuelConfig config = sides;
  const auto network = NetworkPair::create();
  if (!network) return unexpected{network.error()};
  if (settings.call_count > 0) settings.sample_count = settings.call_count;
  const RunPlan plan{.sample_count = 10'000,
                     .warm_up_count = kWarmUpCount,
                     .turn_size = kTurnSize,
                     .rest_part = 0.1};
  const std::uint64_t count =
      settings.sample_count == 0 ? plan.sample_count : settings.sample_count;
  const auto round_count = static_cast<std::uint64_t>(settings.round_count);
  config.host = NetworkPair::kServerAddress;
  config.enter_server_host = [&] { return network->enter(NetworkPair::Host::kServer); };
  config.numbered_count = count + round_count + kWarmUpCount * (count / kTurnSize + round_count);
  Run run(settings, plan, report);
  Outcomes outcomes;
  auto measured = run.measure(start_duel(
      config, [&](Duel& duel) { return connect(duel, settings, config, *network, outcomes); }));
  if (!measured) return measured;
  Json head = head_of("two-node", config);
  head["drop_percent"] = settings.drop_percent;
  expected<std::uint64_t, std::string> dropped = std::uint64_t{0};
  if (settings.drop_percent > 0) dropped = network->dropped_count();
  if (!dropped) return unexpected{dropped.error()};
  run.report(head, tell(outcomes, *dropped));
  return {};
}

}  // namespace

void run_two_node(const Settings& settings, Report& report) {
  Settings chosen = settings;
  // Shared memory stays on one host. TCP repeats after 200 ms at the soonest: under loss this would
  // measure the kernel's patience, and take minutes.
  std::erase_if(chosen.carriers, [&](Carrier carrier) {
    return carrier == Carrier::kSharedMemory ||
           (carrier == Carrier::kTcp && settings.drop_percent > 0);
  });
  if (chosen.carriers.empty()) {
    report.fail("two-node",
                "only UDP and, where nothing is dropped, TCP run between two hosts; add "
                "--transport udp");
  }
  measure_each("two-node", chosen, report, false, measure);
}

}  // namespace rtpm::bench
