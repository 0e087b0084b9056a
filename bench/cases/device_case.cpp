#include "cases/case.hpp"
#include "rtpm/device_sim/sim_driver.hpp"
#include "rtpm/gvd/client.hpp"
#include "rtpm/gvd/server.hpp"

// The paper's loop, closed through a device: each cycle reads the arm's newest sample and commands
// a force from it, two calls. The floor is two raw echoes. The device runs in both sides' turns, so
// that its own thread, which is more urgent than all, disturbs them alike.
namespace rtpm::bench {
namespace {

constexpr Priority kDevicePriority{30000};
constexpr const char* kDeviceName = "bench/arm";

Outcome<std::string> serve_device(const DuelConfig& config) {
  auto driver = device_sim::SimDriver::create({});
  if (!driver) return failure(driver.error());
  gvd::DeviceServerConfig device_config;
  // The device sees the other side's turn as silence.
  device_config.cycle.lease.silence_max = std::chrono::minutes{10};
  device_config.cycle.lease.idle_max = std::chrono::minutes{10};
  device_config.thread = {.name = "device",
                          .priority = kDevicePriority,
                          .cpus = {config.placement.server_cpu},
                          .realtime = config.realtime};
  auto device = gvd::DeviceServer::create(std::move(*driver), device_config);
  if (!device) return failure(device.error());
  auto server = open_server({.name = "rtpm-bench",
                             .lanes = {{.name = "rtpm-device",
                                        .priority = kHighPriority,
                                        .wait = config.wait,
                                        .cpus = {config.placement.server_cpu}}},
                             .realtime = config.realtime},
                            kDeviceName, (*device)->servant());
  if (!server) return failure(server.error());
  // Both serve until the process ends.
  if (auto started = (*device).release()->start(); !started) {
    return failure(started.error());
  }
  if (auto started = (*server)->start(); !started) return failure(started.error());
  return (*server).release()->url(kDeviceName);
}

/// One cycle of the loop.
Outcome<> run_cycle(gvd::DeviceClient& arm) {
  const auto sample = arm.read();
  if (!sample) return failure(sample.error());
  const driver::Vector3& at = sample->pose.position_m;
  return outcome(arm.set_force({-40 * at.x, -40 * at.y, -40 * at.z}));
}

Outcome<Contenders> connect(Duel& duel, const std::string& device) {
  auto opened = gvd::DeviceClient::open(duel.node(), device);
  if (!opened) return failure(opened.error());
  // Shared because calls are copied.
  auto arm = std::make_shared<gvd::DeviceClient>(std::move(*opened));
  if (auto acquired = arm->acquire(); !acquired) return failure(acquired.error());
  const ServerProcess& floor_server = duel.server(Side::kFloor);
  const Running running({&floor_server});
  auto floor = duel.connect(Side::kFloor);
  if (!floor) return failure(floor.error());
  return Contenders{make_contender({}, [arm](Duration) { return run_cycle(*arm); }),
                    make_contender({&floor_server}, [echo = std::move(*floor)](Duration) {
                      auto first = echo({});
                      return first ? echo({}) : first;
                    })};
}

}  // namespace

Outcome<> measure_device(const Settings& settings, const DuelConfig& config, Report& report) {
  const auto device = ServerProcess::start([&] { return serve_device(config); });
  if (!device) return failure(device.error());
  Run run(settings,
          {.sample_count = 10'000,
           .warm_up_count = 20,
           .turn_size = settings.paced_count(0.25),
           .is_round_a_turn = true,
           .rate_hz = settings.rate_hz,
           .count_from = CountFrom::kDue},
          report);
  auto measured = run.measure(
      start_duel(config, [&](const auto& duel) { return connect(*duel, device->address()); }));
  if (measured) run.report(head_of("device", config));
  return measured;
}

}  // namespace rtpm::bench
