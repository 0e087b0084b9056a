#include "configuration.hpp"

#include <algorithm>
#include <vector>

#include "rtpm/names/defaults.hpp"

namespace rtpm::deviced {
namespace {

void add_device(options::Options& options, Configuration& configuration) {
  options.add("name", configuration.name, "Under which clients find the device");
  options.add_choice("device", configuration.device, {"sim"}, "Which driver: sim, a simulated arm");
  options.add("hand", configuration.hand,
              "sim: a recorded hand, a CSV file of t_s,x_m,y_m,z_m, played there and back");
  options.add("free", configuration.is_free, "sim: no hand holds the arm");
  options.add("seed", configuration.seed, "sim: fixes the tremor of the hand");
  options.add("rate", configuration.rate_hz, "Cycles of the device's loop per second, in Hz",
              {10, 50000});
  options.add("device-priority", configuration.device_priority,
              "Of the device's own thread, above every caller's");
}

/// Two lanes: haptic loops, which come at a steady pace, are waited for as they come and are never
/// behind anything else; the rest (displays, tools, set-up) blocks and costs nothing while it is
/// idle.
std::vector<rpc::LaneConfig> default_lanes() {
  constexpr Priority kHigh{16384};
  return {{.name = "lane-rest", .wait = {.strategy = rt::WaitStrategy::kBlock}},
          {.name = "lane-haptic",
           .low = kHigh,
           .priority = kHigh,
           .wait = {.strategy = rt::WaitStrategy::kPeriodic}}};
}

void add_service(options::Options& options, Configuration& configuration) {
  options.add_registry(configuration.registry);
  options.add("allow-takeover", configuration.allows_takeover,
              "Take the name from another server that holds it, at the start");
  configuration.settings.server.lanes = default_lanes();
  options::add_server(options, configuration.settings);
}

/// Where the most urgent lane begins.
Priority highest_low(const Configuration& configuration) {
  Priority highest = Priority::kLowest;
  for (const rpc::LaneConfig& lane : configuration.settings.server.lanes)
    highest = std::max(highest, lane.low);
  return highest;
}

void add_safety(options::Options& options, Configuration& configuration) {
  constexpr options::Range<Duration> kUpTo10s{Duration{0}, std::chrono::seconds{10}};
  options.add("force-max", configuration.force_max_newton,
              "Greatest force in newton; 0: all that the device gives", {0, 1000});
  options.add("hold-max", configuration.hold_max, "Longest life of one command", kUpTo10s);
  options.add("ramp", configuration.ramp, "From full force to none when commands stop", kUpTo10s);
  options.add("soft-start", configuration.soft_start, "From none to full force", kUpTo10s);
  constexpr options::Range<Duration> kLease{std::chrono::milliseconds{10}, std::chrono::hours{1}};
  options.add("lease", configuration.lease.silence_max,
              "How long a silent client keeps the right to command", kLease);
  options.add("lease-idle", configuration.lease.idle_max,
              "How long a client keeps the right to command that only renews it", kLease);
  options.add("operator-priority", configuration.operator_priority,
              "From which priority on a call may take the right to command over");
}

}  // namespace

std::optional<int> read_configuration(int argc, const char* const* argv,
                                      Configuration& configuration) {
  configuration.registry = names::kDefaultRegistryUrl;
  options::Options options("rtpm-deviced",
                           "hosts a device: runs its driver and serves it under a name");
  add_device(options, configuration);
  add_service(options, configuration);
  add_safety(options, configuration);
  if (const auto exit_code = options.parse(argc, argv)) return exit_code;
  if (configuration.settings.server.host == "0.0.0.0") {
    return options.usage_error(
        "--host 0.0.0.0 is no address that clients can connect to; give one of this host's");
  }
  if (configuration.device_priority <= highest_low(configuration)) {
    return options.usage_error(
        "--device-priority is not above where the most urgent lane begins, so callers could delay "
        "the device; raise it, or lower that lane's --lane-NAME-low");
  }
  if (configuration.is_free && !configuration.hand.empty()) {
    return options.usage_error("--free and --hand contradict each other; give one of them");
  }
  return std::nullopt;
}

}  // namespace rtpm::deviced
