#include "cases/case.hpp"
#include "rtpm/device_sim/sim_driver.hpp"
#include "rtpm/gvd/client.hpp"
#include "rtpm/gvd/server.hpp"
#include "runs/duel.hpp"
#include "runs/run.hpp"

// The paper's loop, closed through a device: each cycle reads the arm's newest sample and commands
// a force from it, two calls. The floor is two raw echoes. The device runs in both sides' turns, so
// that its own thread, which is more urgent than all, disturbs them alike.
namespace rtpm::bench {
namespace {

constexpr Priority kDevicePriority{30000};
constexpr const char* kDeviceName = "bench/arm";

expected<std::string, std::string> serve_device(const DuelConfig& config) {
  auto driver = device_sim::SimDriver::create({});
  if (!driver) return unexpected{driver.error().text()};
  gvd::DeviceServerConfig device_config;
  // The device sees the other side's turn as silence.
  device_config.cycle.lease.silence_max = std::chrono::minutes{10};
  device_config.cycle.lease.idle_max = std::chrono::minutes{10};
  device_config.thread = {.name = "device",
                          .priority = kDevicePriority,
                          .cpus = {config.placement.server_cpu},
                          .realtime = config.realtime};
  auto device = gvd::DeviceServer::create(std::move(*driver), device_config);
  if (!device) return unexpected{device.error().text()};
  auto server = open_server({.name = "rtpm-bench",
                             .lanes = {{.name = "rtpm-device",
                                        .priority = kHighPriority,
                                        .wait = config.wait,
                                        .cpus = {config.placement.server_cpu}}},
                             .realtime = config.realtime},
                            kDeviceName, (*device)->servant());
  if (!server) return unexpected{server.error()};
  // Both serve until the process ends.
  if (auto started = (*device).release()->start(); !started) {
    return unexpected{started.error().text()};
  }
  if (auto started = (*server)->start(); !started) return unexpected{started.error().text()};
  return (*server).release()->url(kDeviceName);
}

/// One cycle of the loop.
class DeviceLoop final : public Caller {
 public:
  explicit DeviceLoop(gvd::DeviceClient arm) : arm_(std::move(arm)) {}

  expected<void, std::string> echo() override {
    const auto sample = arm_.read();
    if (!sample) return unexpected{std::string(gvd::to_string(sample.error()))};
    const driver::Vector3& at = sample->pose.position_m;
    const auto commanded = arm_.set_force({-40 * at.x, -40 * at.y, -40 * at.z});
    if (!commanded) return unexpected{std::string(gvd::to_string(commanded.error()))};
    return {};
  }

 private:
  gvd::DeviceClient arm_;
};

/// The floor's cycle.
class TwoEchoes final : public Caller {
 public:
  explicit TwoEchoes(std::unique_ptr<Caller> floor) : floor_(std::move(floor)) {}

  expected<void, std::string> echo() override {
    if (auto first = floor_->echo(); !first) return first;
    return floor_->echo();
  }

 private:
  std::unique_ptr<Caller> floor_;
};

expected<Contenders, std::string> connect(Duel& duel, const std::string& device) {
  auto arm = gvd::DeviceClient::open(duel.high_node(), device);
  if (!arm) return unexpected{arm.error().text()};
  if (auto acquired = arm->acquire(); !acquired) {
    return unexpected{std::string(gvd::to_string(acquired.error()))};
  }
  const ServerProcess& floor_server = duel.server(Side::kFloor);
  const Running running({&floor_server});
  auto floor = duel.connect_high(Side::kFloor);
  if (!floor) return unexpected{floor.error()};
  Contenders contenders;
  contenders.push_back(std::make_unique<CallContender>(
      std::vector<const ServerProcess*>{}, std::make_unique<DeviceLoop>(std::move(*arm))));
  contenders.push_back(std::make_unique<CallContender>(
      std::vector{&floor_server}, std::make_unique<TwoEchoes>(std::move(*floor))));
  return contenders;
}

expected<void, std::string> measure(const Settings& settings, const DuelConfig& config,
                                    Report& report) {
  const auto device = ServerProcess::start([&] { return serve_device(config); });
  if (!device) return unexpected{device.error()};
  Run run(settings,
          {.sample_count = 10'000,
           .warm_up_count = 20,
           .turn_size = settings.paced_count(0.25),
           .is_round_a_turn = true,
           .rate_hz = settings.rate_hz,
           .count_from = CountFrom::kDue},
          report);
  auto measured =
      run.measure(start_duel(config, [&](Duel& duel) { return connect(duel, device->address()); }));
  if (measured) run.report(head_of("device", config));
  return measured;
}

}  // namespace

void run_device(const Settings& settings, Report& report) {
  measure_each("device", settings, report, true, measure);
}

}  // namespace rtpm::bench
