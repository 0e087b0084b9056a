#include <algorithm>
#include <array>

#include "cases/case.hpp"
#include "figures/disturbance.hpp"
#include "rtpm/device_sim/sim_driver.hpp"
#include "rtpm/gvd/client.hpp"
#include "rtpm/gvd/server.hpp"
#include "rtpm/rt/clock.hpp"
#include "runs/duel.hpp"
#include "runs/paced_calls.hpp"
#include "sides/server_process.hpp"

// The paper's loop, closed through a device: each cycle reads the arm's newest sample and commands
// a force from it, two calls. The floor is two raw echoes. The device runs in both sides' turns, so
// that its own thread, which is more urgent than all, disturbs them alike.
namespace rtpm::bench {
namespace {

constexpr std::uint64_t kSampleCountDefault = 10'000;
constexpr double kTurnS = 0.5;
constexpr int kWarmUpCount = 20;
constexpr Priority kDevicePriority{30000};
constexpr const char* kDeviceName = "bench/arm";

expected<ServerProcess, std::string> start_device(const DuelConfig& config) {
  return ServerProcess::start([config]() -> expected<std::string, std::string> {
    auto driver = device_sim::SimDriver::create({});
    if (!driver) return unexpected{driver.error().text()};
    gvd::DeviceServerConfig device_config;
    // The other side's turn is a silence.
    device_config.cycle.lease.silence_max = std::chrono::minutes{10};
    device_config.cycle.lease.idle_max = std::chrono::minutes{10};
    device_config.thread = {.name = "device",
                            .priority = kDevicePriority,
                            .cpus = {config.placement.server_cpu},
                            .realtime = config.realtime};
    auto device = gvd::DeviceServer::create(std::move(*driver), device_config);
    if (!device) return unexpected{device.error().text()};
    auto server = rpc::Server::create({.name = "rtpm-bench",
                                       .lanes = {{.name = "rtpm-device",
                                                  .priority = kHighPriority,
                                                  .wait = config.wait,
                                                  .cpus = {config.placement.server_cpu}}},
                                       .realtime = config.realtime});
    if (!server) return unexpected{server.error().text()};
    if (auto added = (*server)->add(kDeviceName, (*device)->servant()); !added) {
      return unexpected{added.error().text()};
    }
    // Both serve until the process ends.
    if (auto started = (*device).release()->start(); !started) {
      return unexpected{started.error().text()};
    }
    if (auto started = (*server)->start(); !started) return unexpected{started.error().text()};
    return (*server).release()->url(kDeviceName);
  });
}

/// One cycle of the loop.
class DeviceLoop final : public Caller {
 public:
  explicit DeviceLoop(gvd::DeviceClient arm) : arm_(std::move(arm)) {}

  expected<void, std::string> echo() override {
    const auto sample = arm_.read();
    if (!sample) return unexpected{std::string(rpc::to_string(sample.error()))};
    const driver::Vector3& at = sample->pose.position_m;
    const auto commanded = arm_.set_force({-40 * at.x, -40 * at.y, -40 * at.z});
    if (!commanded) return unexpected{std::string(rpc::to_string(commanded.error()))};
    return {};
  }
  expected<void, std::string> work(Duration) override {
    return unexpected{std::string("a device does not compute for its callers")};
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
  expected<void, std::string> work(Duration duration) override { return floor_->work(duration); }

 private:
  std::unique_ptr<Caller> floor_;
};

expected<std::unique_ptr<Caller>, std::string> open_device(rpc::Node& node,
                                                           const std::string& url) {
  auto arm = gvd::DeviceClient::open(node, url);
  if (!arm) return unexpected{arm.error().text()};
  if (auto acquired = arm->acquire(); !acquired) {
    return unexpected{std::string(rpc::to_string(acquired.error()))};
  }
  return std::unique_ptr<Caller>(std::make_unique<DeviceLoop>(std::move(*arm)));
}

expected<void, std::string> measure(const Settings& settings, Duel& duel, Caller& rtpm,
                                    Caller& floor, std::array<Samples, 2>& samples,
                                    std::size_t count_per_round) {
  const Duration period{static_cast<Duration::rep>(1e9 / settings.rate_hz)};
  const auto turn_size =
      std::max<std::size_t>(1, static_cast<std::size_t>(kTurnS * settings.rate_hz));
  std::size_t first = 0;
  for (int round = 0; round < settings.round_count; ++round) {
    for (Samples& each : samples)
      each.begin_round(round);
    const RoundWatch round_watch = duel.watch_round();
    for (std::size_t done = 0; done < count_per_round; done += turn_size, ++first) {
      for (std::size_t i = 0; i < 2; ++i) {
        const std::size_t which = (i + first) % 2;
        Caller& caller = which == 0 ? rtpm : floor;
        if (which == 0) {
          duel.end_turn();
        } else {
          duel.take_turn(Side::kFloor);
        }
        for (int call = 0; call < kWarmUpCount; ++call) {
          if (auto called = caller.echo(); !called) return called;
        }
        auto called = call_paced(caller, period, std::min(turn_size, count_per_round - done),
                                 CountFrom::kDue, samples[which]);
        if (!called) return called;
      }
    }
    duel.end_turn();
    const bool was_disturbed = round_watch.was_disturbed();
    for (Samples& each : samples)
      each.note_disturbed(was_disturbed);
  }
  return {};
}

expected<Result, std::string> measure_one(const Settings& settings, const DuelConfig& config) {
  if (config.wait.strategy == rt::WaitStrategy::kSpin) {
    return unexpected{
        std::string("a lane that spins would take the CPU from the floor's, which "
                    "runs beside it; use --wait adaptive or --wait block")};
  }
  const auto device = start_device(config);
  if (!device) return unexpected{device.error()};
  auto duel = Duel::start(config);
  if (!duel) return unexpected{duel.error()};
  const std::size_t per_round = samples_per_round(settings, kSampleCountDefault);
  std::array<Samples, 2> samples{Samples(settings.round_count, per_round),
                                 Samples(settings.round_count, per_round)};
  Result result{.title = title_of("device", config) + ", " + short_text(settings.rate_hz) + " Hz"};
  auto measured = run_as_caller(config, [&]() -> expected<void, std::string> {
    const auto node = make_node(config.carrier, config.wait);
    auto rtpm = open_device(*node, device->address());
    if (!rtpm) return unexpected{rtpm.error()};
    (*duel)->take_turn(Side::kFloor);
    auto floor = (*duel)->connect_high();
    if (!floor) return unexpected{floor.error()};
    TwoEchoes echoes(std::move(*floor));
    const DisturbanceWatch watch({device->id(), (*duel)->server_ids().front()});
    auto done = measure(settings, **duel, **rtpm, echoes, samples, per_round);
    if (!done) return done;
    add_comparison(result, "device", config, samples[0], samples[1]);
    result.json.add("rate_hz", settings.rate_hz);
    watch.finish(result, longest_us(result));
    return {};
  });
  if (!measured) return unexpected{measured.error()};
  return result;
}

}  // namespace

bool run_device(const Settings& settings, Report& report) {
  return measure_each("device", measure_one, settings, report);
}

}  // namespace rtpm::bench
