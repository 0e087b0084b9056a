#include "runs/duel.hpp"

#include <algorithm>
#include <optional>
#include <sstream>
#include <utility>

#include "figures/report.hpp"
#include "rtpm/base/assert.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/wire/url.hpp"
#include "sides/floor.hpp"
#include "sides/memory_floor.hpp"
#include "sides/standalone.hpp"

namespace rtpm::bench {
namespace {

/// How low-priority callers and their lane wait: under load there is always work, and while there
/// is none they shall be out of the way.
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
                                      .payload_size = config.payload_size}};
  if (config.low_caller_count > 0) {
    lanes.push_back({.name = "floor-low",
                     .priority = kLowPriority,
                     .wait = kLowWait,
                     .cpu = config.placement.server_cpu,
                     .connection_count = config.low_caller_count,
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
  const rpc::LaneConfig high{.name = "rtpm-high",
                             .low = config.low_caller_count > 0 ? kHighBand : Priority{0},
                             .priority = kHighPriority,
                             .wait = config.wait,
                             .cpus = cpus};
  RtpmServerConfig server{.host = config.host,
                          .lanes = {high},
                          .session_count_max = config.session_count_max,
                          .numbered_count = config.numbered_count,
                          .realtime = config.realtime};
  if (config.low_caller_count == 0) return start_rtpm_server(std::move(server));
  const rpc::LaneConfig low{
      .name = "rtpm-low", .low = 0, .priority = kLowPriority, .wait = kLowWait, .cpus = cpus};
  server.lanes = {low, high};
  return start_rtpm_server(std::move(server));
}

expected<ServerProcess, std::string> start_server(const DuelConfig& config,
                                                  const ServerProcess::SetUp& set_up) {
  return ServerProcess::start([&]() -> expected<std::string, std::string> {
    if (config.enter_server_host) {
      if (auto entered = config.enter_server_host(); !entered) return unexpected{entered.error()};
    }
    return set_up();
  });
}

}  // namespace

struct Duel::Impl {
  DuelConfig config;
  std::unique_ptr<MemoryFloor> memory_floor;  ///< Of shared memory only.
  ServerProcess floor_server;
  ServerProcess rtpm_server;
  std::uint16_t floor_high_port = 0;
  std::uint16_t floor_low_port = 0;
  std::unique_ptr<rpc::Node> high_node;
  std::unique_ptr<rpc::Node> low_node;
  std::optional<Side> turn{};
  bool is_rtpm_joined = false;

  [[nodiscard]] const ServerProcess& server_of(Side side) const {
    return side == Side::kRtpm ? rtpm_server : floor_server;
  }
};

expected<std::unique_ptr<Duel>, std::string> Duel::start(const DuelConfig& config) {
  if (config.wait.strategy == rt::WaitStrategy::kSpin &&
      config.placement.client_cpu == config.placement.server_cpu) {
    return unexpected{
        std::string("callers and servers that spin need two CPUs, and this process "
                    "may use one only; use --wait adaptive or --wait block")};
  }
  // Each is stopped before the other starts: a spinning server would not let the other's threads on
  // their CPU.
  std::unique_ptr<MemoryFloor> memory_floor;
  if (floor_carrier_of(config) == Carrier::kSharedMemory) {
    auto created = MemoryFloor::create({1, config.low_caller_count}, config.payload_size);
    if (!created) return unexpected{created.error()};
    memory_floor = std::move(*created);
  }
  auto floor_server =
      start_server(config, [&] { return set_up_floor(config, memory_floor.get()); });
  if (!floor_server) return unexpected{floor_server.error()};
  floor_server->pause();
  auto rtpm_server = start_server(config, [&] { return set_up_rtpm(config); });
  if (!rtpm_server) return unexpected{rtpm_server.error()};
  rtpm_server->pause();
  auto impl = std::make_unique<Impl>(Impl{.config = config,
                                          .memory_floor = std::move(memory_floor),
                                          .floor_server = std::move(*floor_server),
                                          .rtpm_server = std::move(*rtpm_server),
                                          .high_node = make_node(config.carrier, config.wait),
                                          .low_node = make_node(config.carrier, kLowWait)});
  std::istringstream ports(impl->floor_server.address());
  ports >> impl->floor_high_port >> impl->floor_low_port;
  return std::unique_ptr<Duel>(new Duel(std::move(impl)));
}

Duel::Duel(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}

Duel::~Duel() = default;

void Duel::take_turn(Side side) {
  if (impl_->turn == side) return;
  end_turn();
  impl_->server_of(side).resume();
  impl_->turn = side;
}

void Duel::join_rtpm() {
  if (impl_->turn == Side::kRtpm || impl_->is_rtpm_joined) return;
  impl_->rtpm_server.resume();
  impl_->is_rtpm_joined = true;
}

void Duel::end_turn() {
  if (std::exchange(impl_->is_rtpm_joined, false)) impl_->rtpm_server.pause();
  if (impl_->turn) impl_->server_of(*impl_->turn).pause();
  impl_->turn.reset();
}

RoundWatch Duel::watch_round() {
  end_turn();
  return RoundWatch();
}

void Duel::rest_after(Duration turn, double part) {
  end_turn();
  const auto rest = static_cast<Duration::rep>(part * static_cast<double>(turn.count()));
  rt::sleep_until(rt::now() + Duration{rest});
}

expected<std::unique_ptr<Caller>, std::string> Duel::connect_high() {
  if (impl_->turn == Side::kFloor) {
    if (impl_->memory_floor) return impl_->memory_floor->connect(0, impl_->config.wait);
    return connect_floor_caller(floor_carrier_of(impl_->config), impl_->config.host,
                                impl_->floor_high_port, impl_->config.wait,
                                impl_->config.payload_size);
  }
  return connect_rtpm_caller(*impl_->high_node, impl_->rtpm_server.address(), kHighPriority,
                             impl_->config.payload_size);
}

expected<std::unique_ptr<Caller>, std::string> Duel::connect_by(rpc::Node& node) {
  return connect_rtpm_caller(node, impl_->rtpm_server.address(), kHighPriority);
}

expected<std::unique_ptr<Caller>, std::string> Duel::connect_low() {
  if (impl_->turn == Side::kFloor) {
    if (impl_->memory_floor) return impl_->memory_floor->connect(1, kLowWait);
    return connect_floor_caller(floor_carrier_of(impl_->config), impl_->config.host,
                                impl_->floor_low_port, kLowWait);
  }
  return connect_rtpm_caller(*impl_->low_node, impl_->rtpm_server.address(), kLowPriority);
}

expected<Job, std::string> Duel::connect_large(std::size_t size) {
  return connect_large_job(*impl_->low_node, impl_->rtpm_server.address(), kLowPriority, size);
}

expected<std::unique_ptr<NumberedCaller>, std::string> Duel::connect_numbered() {
  return connect_numbered_caller(*impl_->high_node, impl_->rtpm_server.address(), kHighPriority);
}

expected<std::unique_ptr<Pipeline>, std::string> Duel::connect_pipeline(std::size_t in_flight) {
  if (impl_->turn == Side::kFloor) {
    return connect_floor_pipeline(impl_->config.host, impl_->floor_high_port, in_flight);
  }
  return connect_rtpm_pipeline(*impl_->high_node, impl_->rtpm_server.address(), kHighPriority,
                               in_flight);
}

std::uint16_t Duel::rtpm_port() const {
  const auto url = wire::parse_url(impl_->rtpm_server.address());
  RTPM_ASSERT(url.has_value(), "a server gives a URL");
  return url->port;
}

Duration Duel::rtpm_server_cpu_time() const {
  return cpu_time_of(impl_->rtpm_server.id());
}

std::vector<pid_t> Duel::server_ids() const {
  return {impl_->floor_server.id(), impl_->rtpm_server.id()};
}

expected<void, std::string> run_as_caller(
    const DuelConfig& config, const std::function<expected<void, std::string>()>& body) {
  expected<void, std::string> outcome;
  auto thread = rt::Thread::start({.name = "bench-caller",
                                   .priority = kHighPriority,
                                   .cpus = {config.placement.client_cpu},
                                   .realtime = config.realtime},
                                  [&] { outcome = body(); });
  if (!thread) return unexpected{thread.error().text()};
  thread->join();
  return outcome;
}

bool measure_each(std::string_view case_name, Measurement measure, const Settings& settings,
                  Report& report, std::size_t payload_size) {
  bool is_complete = true;
  for (const Carrier carrier : settings.carriers) {
    for (const rt::WaitStrategy strategy : settings.waits) {
      const DuelConfig config{.carrier = carrier,
                              .wait = {.strategy = strategy, .spin = settings.spin},
                              .payload_size = payload_size,
                              .placement = choose_placement(),
                              .realtime = settings.realtime};
      const auto result = measure(settings, config);
      if (result) {
        report.add(*result);
      } else {
        say_not_measured(title_of(case_name, config), result.error());
        is_complete = false;
      }
    }
  }
  return is_complete;
}

std::string title_of(std::string_view case_name, const DuelConfig& config) {
  std::string title = std::string(case_name) + ", " + std::string(to_string(config.carrier));
  if (config.floor_carrier)
    title += " beside raw " + std::string(to_string(*config.floor_carrier)) + " sockets";
  return title + ", " + std::string(rt::to_string(config.wait.strategy)) + " wait, " +
         std::to_string(config.payload_size) + " bytes";
}

void add_comparison(Result& result, std::string_view case_name, const DuelConfig& config,
                    const Samples& rtpm, const Samples& floor) {
  JsonObject& json = result.json;
  json.add("case", case_name);
  json.add("transport", to_string(config.carrier));
  if (config.floor_carrier) json.add("floor", to_string(*config.floor_carrier));
  json.add("wait", rt::to_string(config.wait.strategy));
  json.add("payload", static_cast<std::int64_t>(config.payload_size));
  json.add("n", static_cast<std::int64_t>(rtpm.count()));
  const Percentiles rtpm_values = rtpm.percentiles();
  const Percentiles floor_values = floor.percentiles();
  add_distribution(json, "", rtpm);
  add_distribution(json, "floor_", floor);
  Percentiles ratios = add_ratios(json, "ratio_", rtpm, floor);
  if (floor_values.p9999 > 0) ratios.p9999 = rtpm_values.p9999 / floor_values.p9999;
  if (floor_values.max > 0) ratios.max = rtpm_values.max / floor_values.max;
  result.rows.push_back({"RTPM", rtpm_values});
  result.rows.push_back({"raw floor", floor_values});
  result.rows.push_back({"ratio (no unit)", ratios});
  add_rounds(result, rtpm, floor);
}

void add_latencies(Result& result, const Samples& rtpm, const Samples& floor) {
  result.json.add("latencies_us", rtpm.all_us());
  result.json.add("floor_latencies_us", floor.all_us());
}

double longest_us(const Result& result) {
  return std::max(result.rows.at(0).values.max, result.rows.at(1).values.max);
}

}  // namespace rtpm::bench
