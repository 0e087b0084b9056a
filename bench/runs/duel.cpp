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

FloorLaneConfig high_lane(const DuelConfig& config) {
  return {.name = "floor-high",
          .priority = kHighPriority,
          .wait = config.wait,
          .cpu = config.placement.server_cpu,
          .host = config.host,
          .payload_size = config.payload_size,
          .is_sealed = config.keys != nullptr};
}

FloorLaneConfig low_lane(const DuelConfig& config) {
  return {.name = "floor-low",
          .priority = kLowPriority,
          .wait = kLowWait,
          .cpu = config.placement.server_cpu,
          .connection_count = std::max(1, config.low_caller_count),
          .host = config.host};
}

Outcome<std::string> set_up_floor(const DuelConfig& config, MemoryFloor* memory) {
  std::vector<FloorLaneConfig> lanes{high_lane(config)};
  if (config.low_caller_count > 0 || config.has_hello_storm) lanes.push_back(low_lane(config));
  if (memory != nullptr) {
    if (auto served = memory->serve(lanes, config.realtime); !served) {
      return failure(served.error());
    }
    return std::string("0 0");
  }
  const auto ports = start_floor_server(floor_carrier_of(config), lanes, config.realtime);
  if (!ports) return failure(ports.error());
  std::string text;
  for (const std::uint16_t port : *ports)
    text += std::to_string(port) + " ";
  return text;
}

Outcome<std::string> set_up_rtpm(const DuelConfig& config) {
  const std::vector<int> cpus{config.placement.server_cpu};
  rpc::ServerConfig server{
      .host = config.host,
      .lanes = {{.name = "rtpm-high",
                 .low = config.low_caller_count > 0 ? kHighBand : Priority{0},
                 .priority = kHighPriority,
                 .wait = config.wait,
                 .cpus = cpus}},
      .realtime = config.realtime,
      .session_count_max = config.session_count_max,
      .security = config.keys ? config.keys->server() : rpc::ServerSecurity{.is_insecure = true}};
  if (config.low_caller_count > 0) {
    server.lanes.insert(
        server.lanes.begin(),
        {.name = "rtpm-low", .low = 0, .priority = kLowPriority, .wait = kLowWait, .cpus = cpus});
  }
  return start_rtpm_server(std::move(server));
}

/// Starts a server stopped: one that spins would keep the other's threads off their CPU.
Outcome<ServerProcess> start_server(const DuelConfig& config, const ServerProcess::SetUp& set_up) {
  auto server = ServerProcess::start([&]() -> Outcome<std::string> {
    if (config.enter_server_host) {
      if (auto entered = config.enter_server_host(); !entered) return failure(entered.error());
    }
    return set_up();
  });
  if (server) server->pause();
  return server;
}

}  // namespace

Outcome<std::shared_ptr<Duel>> Duel::start(const DuelConfig& config) {
  if (config.wait.strategy == rt::WaitStrategy::kSpin &&
      config.placement.client_cpu == config.placement.server_cpu) {
    return failure(
        "callers and servers that spin need two CPUs, and this process may use one only; use "
        "--wait adaptive or --wait block");
  }
  std::unique_ptr<MemoryFloor> memory;
  if (floor_carrier_of(config) == Carrier::kSharedMemory) {
    auto created = MemoryFloor::create({1, config.low_caller_count}, config.payload_size);
    if (!created) return failure(created.error());
    memory = std::move(*created);
  }
  auto floor = start_server(config, [&] { return set_up_floor(config, memory.get()); });
  if (!floor) return failure(floor.error());
  auto rtpm = start_server(config, [&] { return set_up_rtpm(config); });
  if (!rtpm) return failure(rtpm.error());
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

Outcome<Call> Duel::connect(Side side) {
  if (side == Side::kRtpm) {
    return connect_rtpm_caller(*high_node_, rtpm_url(), kHighPriority, config_.payload_size);
  }
  if (memory_floor_) return memory_floor_->connect(0, config_.wait);
  return connect_floor_caller(floor_carrier_of(config_), floor_ports_[0], high_lane(config_));
}

Outcome<Pipeline> Duel::connect_pipeline(Side side) {
  if (side == Side::kFloor) return connect_floor_pipeline(floor_ports_[0], high_lane(config_));
  return connect_rtpm_pipeline(*high_node_, rtpm_url(), kHighPriority);
}

Outcome<Call> Duel::connect_low(Side side) {
  if (side == Side::kRtpm) return connect_rtpm_caller(*low_node_, rtpm_url(), kLowPriority);
  if (memory_floor_) return memory_floor_->connect(1, kLowWait);
  return connect_floor_caller(floor_carrier_of(config_), floor_ports_[1], low_lane(config_));
}

Outcome<Call> Duel::connect_storm(Side side) {
  if (side == Side::kRtpm) {
    const auto url = wire::parse_url(rtpm_url());
    if (!url) return failure(rtpm_url() + " is no URL");
    return make_hello_storm(url->port);
  }
  auto caller = connect_low(side);
  if (!caller) return caller;
  return paced_as_hellos(std::move(*caller));
}

Outcome<Contender> Duel::contender(Side side) {
  const Running running({&server(side)});
  auto high = connect(side);
  if (!high) return failure(high.error());
  std::vector<Call> callers;
  for (int i = 0; i < config_.low_caller_count + (config_.has_hello_storm ? 1 : 0); ++i) {
    auto caller = i < config_.low_caller_count ? connect_low(side) : connect_storm(side);
    if (!caller) return failure(caller.error());
    callers.push_back(std::move(*caller));
  }
  std::shared_ptr<LowLoad> load;
  if (!callers.empty()) {
    load = std::make_shared<LowLoad>(config_.placement, config_.realtime, std::move(callers),
                                     config_.low_work);
  }
  return make_contender({&server(side)}, std::move(*high), std::move(load));
}

Outcome<Contenders> Duel::contenders() {
  Contenders both;
  for (const Side side : kBothSides) {
    auto one = contender(side);
    if (!one) return failure(one.error());
    both.push_back(std::move(*one));
  }
  return both;
}

Contender make_contender(std::vector<const ServerProcess*> servers, Call caller,
                         std::shared_ptr<LowLoad> load) {
  return [servers = std::move(servers), caller = std::move(caller), load = std::move(load)](
             const TurnPlan& plan, Finding& finding) {
    const Running running(servers);
    return run_turn(plan, caller, load.get(), finding);
  };
}

Start start_duel(const DuelConfig& config,
                 std::function<Outcome<Contenders>(const std::shared_ptr<Duel>&)> connect) {
  return [config, connect = std::move(connect)]() -> Outcome<Connect> {
    auto duel = Duel::start(config);
    if (!duel) return failure(duel.error());
    return Connect([duel = *duel, connect] { return connect(duel); });
  };
}

Outcome<Client> bind_client(Carrier carrier, const rt::WaitConfig& wait, const std::string& url) {
  Client client{.node = make_node(carrier, wait), .caller = {}};
  auto caller = connect_rtpm_caller(*client.node, url, kHighPriority);
  if (!caller) return failure(caller.error());
  client.caller = std::move(*caller);
  if (auto called = client.caller({}); !called) return failure(called.error());
  return client;
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
