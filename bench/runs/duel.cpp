#include "runs/duel.hpp"

#include <algorithm>
#include <sstream>
#include <utility>

#include "rtpm/wire/url.hpp"
#include "sides/floor.hpp"
#include "sides/hello_storm.hpp"

namespace rtpm::bench {
namespace {

/// The wait of low-priority callers and their lane: under load there is always work, and without
/// load they shall be out of the way.
constexpr rt::WaitConfig kLowWait{.strategy = rt::WaitStrategy::kBlock};

Carrier floor_carrier_of(const DuelConfig& config) {
  return config.floor_carrier.value_or(config.carrier);
}

expected<std::string, std::string> set_up_floor(const DuelConfig& config, MemoryFloor* memory) {
  std::vector<FloorLaneConfig> lanes{{.name = "floor-high",
                                      .priority = kHighPriority,
                                      .wait = config.wait,
                                      .cpu = config.placement.server_cpu,
                                      .host = config.host,
                                      .payload_size = config.payload_size,
                                      .is_sealed = config.keys != nullptr}};
  if (config.low_caller_count > 0 || config.has_hello_storm) {
    lanes.push_back({.name = "floor-low",
                     .priority = kLowPriority,
                     .wait = kLowWait,
                     .cpu = config.placement.server_cpu,
                     .connection_count = std::max(1, config.low_caller_count),
                     .host = config.host});
  }
  if (memory != nullptr) {
    if (auto served = memory->serve(lanes, config.realtime); !served) {
      return unexpected{served.error()};
    }
    return std::string("0 0");
  }
  const auto ports = start_floor_server(floor_carrier_of(config), lanes, config.realtime);
  if (!ports) return unexpected{ports.error()};
  std::string text;
  for (const std::uint16_t port : *ports)
    text += std::to_string(port) + " ";
  return text;
}

expected<std::string, std::string> set_up_rtpm(const DuelConfig& config) {
  const std::vector<int> cpus{config.placement.server_cpu};
  RtpmServerConfig server{.host = config.host,
                          .lanes = {{.name = "rtpm-high",
                                     .low = config.low_caller_count > 0 ? kHighBand : Priority{0},
                                     .priority = kHighPriority,
                                     .wait = config.wait,
                                     .cpus = cpus}},
                          .session_count_max = config.session_count_max,
                          .realtime = config.realtime};
  if (config.keys) server.security = config.keys->server();
  if (config.low_caller_count > 0) {
    server.lanes.insert(
        server.lanes.begin(),
        {.name = "rtpm-low", .low = 0, .priority = kLowPriority, .wait = kLowWait, .cpus = cpus});
  }
  return start_rtpm_server(std::move(server));
}

/// Starts a server stopped: one that spins would keep the other's threads off their CPU.
expected<ServerProcess, std::string> start_server(const DuelConfig& config,
                                                  const ServerProcess::SetUp& set_up) {
  auto server = ServerProcess::start([&]() -> expected<std::string, std::string> {
    if (config.enter_server_host) {
      if (auto entered = config.enter_server_host(); !entered) return unexpected{entered.error()};
    }
    return set_up();
  });
  if (server) server->pause();
  return server;
}

}  // namespace

expected<std::shared_ptr<Duel>, std::string> Duel::start(const DuelConfig& config) {
  if (config.wait.strategy == rt::WaitStrategy::kSpin &&
      config.placement.client_cpu == config.placement.server_cpu) {
    return unexpected{
        std::string("callers and servers that spin need two CPUs, and this process "
                    "may use one only; use --wait adaptive or --wait block")};
  }
  std::unique_ptr<MemoryFloor> memory;
  if (floor_carrier_of(config) == Carrier::kSharedMemory) {
    auto created = MemoryFloor::create({1, config.low_caller_count}, config.payload_size);
    if (!created) return unexpected{created.error()};
    memory = std::move(*created);
  }
  auto floor = start_server(config, [&] { return set_up_floor(config, memory.get()); });
  if (!floor) return unexpected{floor.error()};
  auto rtpm = start_server(config, [&] { return set_up_rtpm(config); });
  if (!rtpm) return unexpected{rtpm.error()};
  return std::shared_ptr<Duel>(
      new Duel(config, std::move(memory), std::move(*floor), std::move(*rtpm)));
}

Duel::Duel(DuelConfig config, std::unique_ptr<MemoryFloor> memory, ServerProcess floor,
           ServerProcess rtpm)
    : config_(std::move(config)),
      memory_floor_(std::move(memory)),
      floor_(std::move(floor)),
      rtpm_(std::move(rtpm)),
      high_node_(make_node(config_.carrier, config_.wait,
                           config_.keys ? config_.keys->node() : rpc::NodeSecurity{})),
      low_node_(make_node(config_.carrier, kLowWait)) {
  std::istringstream(floor_.address()) >> floor_ports_[0] >> floor_ports_[1];
}

expected<std::unique_ptr<Caller>, std::string> Duel::connect_high(Side side) {
  if (side == Side::kRtpm) {
    return connect_rtpm_caller(*high_node_, rtpm_url(), kHighPriority, config_.payload_size);
  }
  if (memory_floor_) return memory_floor_->connect(0, config_.wait);
  return connect_floor_caller(floor_carrier_of(config_), config_.host, floor_ports_[0],
                              config_.wait, config_.payload_size, config_.keys != nullptr);
}

expected<Job, std::string> Duel::connect_storm(Side side) {
  if (side == Side::kRtpm) {
    const auto url = wire::parse_url(rtpm_url());
    if (!url) return unexpected{rtpm_url() + " is no URL"};
    return make_hello_storm(url->port);
  }
  auto caller = connect_low(side);
  if (!caller) return unexpected{caller.error()};
  return paced_as_hellos(
      [held = std::shared_ptr<Caller>(std::move(*caller))] { return held->echo(); });
}

expected<std::unique_ptr<Caller>, std::string> Duel::connect_low(Side side) {
  if (side == Side::kRtpm) return connect_rtpm_caller(*low_node_, rtpm_url(), kLowPriority);
  if (memory_floor_) return memory_floor_->connect(1, kLowWait);
  return connect_floor_caller(floor_carrier_of(config_), config_.host, floor_ports_[1], kLowWait);
}

expected<std::unique_ptr<Contender>, std::string> Duel::contender(Side side, Duration work) {
  const Running running({&server(side)});
  auto high = connect_high(side);
  if (!high) return unexpected{high.error()};
  std::vector<Job> jobs;
  for (int i = 0; i < config_.low_caller_count; ++i) {
    auto caller = connect_low(side);
    if (!caller) return unexpected{caller.error()};
    // Shared, because a job is copied.
    jobs.emplace_back(
        [held = std::shared_ptr<Caller>(std::move(*caller)), work] { return held->work(work); });
  }
  if (config_.has_hello_storm) {
    auto storm = connect_storm(side);
    if (!storm) return unexpected{storm.error()};
    jobs.push_back(std::move(*storm));
  }
  std::unique_ptr<LowLoad> load;
  if (!jobs.empty()) {
    load = std::make_unique<LowLoad>(config_.placement, config_.realtime, std::move(jobs));
  }
  return std::make_unique<CallContender>(std::vector{&server(side)}, std::move(*high),
                                         std::move(load));
}

expected<Contenders, std::string> Duel::contenders(Duration work) {
  Contenders both;
  for (const Side side : kBothSides) {
    auto one = contender(side, work);
    if (!one) return unexpected{one.error()};
    both.push_back(std::move(*one));
  }
  return both;
}

Start start_duel(const DuelConfig& config,
                 std::function<expected<Contenders, std::string>(Duel&)> connect) {
  return [config, connect = std::move(connect)]() -> expected<Connect, std::string> {
    auto duel = Duel::start(config);
    if (!duel) return unexpected{duel.error()};
    return Connect([duel = *duel, connect] { return connect(*duel); });
  };
}

expected<Client, std::string> bind_client(Carrier carrier, const rt::WaitConfig& wait,
                                          const std::string& url) {
  Client client{.node = make_node(carrier, wait), .caller = nullptr};
  auto caller = connect_rtpm_caller(*client.node, url, kHighPriority);
  if (!caller) return unexpected{caller.error()};
  client.caller = std::move(*caller);
  if (auto called = client.caller->echo(); !called) return unexpected{called.error()};
  return client;
}

expected<void, std::string> run_as_caller(
    const Settings& settings, const std::function<expected<void, std::string>()>& body) {
  expected<void, std::string> outcome;
  auto thread = rt::Thread::start({.name = "bench-caller",
                                   .priority = kHighPriority,
                                   .cpus = {choose_placement().client_cpu},
                                   .realtime = settings.realtime},
                                  [&] { outcome = body(); });
  if (!thread) return unexpected{thread.error().text()};
  thread->join();
  return outcome;
}

void measure_each(std::string_view case_name, const Settings& settings, Report& report,
                  bool shares_cpu, Measure measure) {
  for (const Carrier carrier : settings.carriers) {
    for (const rt::WaitStrategy strategy : settings.waits) {
      const std::string title = std::string(case_name) + ", " + std::string(to_string(carrier)) +
                                ", " + std::string(rt::to_string(strategy)) + " wait";
      if (shares_cpu && strategy == rt::WaitStrategy::kSpin) {
        report.fail(title,
                    "what spins would starve what shares its CPU; use --wait adaptive or "
                    "--wait block");
        continue;
      }
      DuelConfig config{.carrier = carrier,
                        .wait = {.strategy = strategy},
                        .placement = choose_placement(),
                        .realtime = settings.realtime};
      if (settings.is_sealed) {
        auto keys = SealedKeys::make(config.host);
        if (!keys) {
          report.fail(title, keys.error());
          continue;
        }
        config.keys = std::move(*keys);
      }
      const auto measured = measure(settings, config, report);
      if (!measured) report.fail(title, measured.error());
    }
  }
}

Json head_of(std::string_view case_name, const DuelConfig& config) {
  const std::string name = std::string(case_name) + (config.keys ? "-sealed" : "");
  Json head{{"case", name}, {"transport", to_string(config.carrier)}};
  if (config.floor_carrier) head["floor"] = to_string(*config.floor_carrier);
  head["wait"] = rt::to_string(config.wait.strategy);
  head["payload"] = config.payload_size;
  return head;
}

}  // namespace rtpm::bench
