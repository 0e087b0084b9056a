// A 1 kHz force loop: everything below z = 0 is a wall, which this real-time program renders on a
// haptic device. First, in another terminal: rtpm up examples/laboratory.toml
//
//     cpp_servo --duration 10s
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <string>

#include "rtpm/gvd/client.hpp"
#include "rtpm/names/resolver.hpp"
#include "rtpm/options/options.hpp"
#include "rtpm/program/stop_signal.hpp"
#include "rtpm/rpc/node.hpp"
#include "rtpm/rt/cycle_timer.hpp"
#include "rtpm/rt/log.hpp"

namespace {

using namespace std::chrono_literals;
using rtpm::gvd::DeviceOutcome;

constexpr double kStiffnessNewtonPerM = 600;  // From 1000 N/m on, it would buzz at 1 kHz.
constexpr int kFailedMax = 1000;              // In a row; then the device counts as lost.

struct Report {
  int cycle_count = 0;
  int touch_count = 0;  ///< Cycles inside the wall.
  double depth_m_max = 0;
  double force_newton_max = 0;
};

/// One cycle: reads the position, computes the force and commands it.
rtpm::gvd::DeviceResult touch(rtpm::gvd::DeviceClient& arm, Report& report) {
  const rtpm::rpc::CallOptions call{.priority = 24000, .deadline = 800us};
  ++report.cycle_count;
  const auto sample = arm.read(call);
  if (!sample) return rtpm::unexpected{sample.error()};
  const double z_m = sample->pose.position_m.z;
  const double force_newton = z_m < 0 ? -kStiffnessNewtonPerM * z_m : 0;  // It never pulls.
  if (z_m < 0) ++report.touch_count;
  report.depth_m_max = std::max(report.depth_m_max, -z_m);
  report.force_newton_max = std::max(report.force_newton_max, force_newton);
  return arm.set_force({0, 0, force_newton}, call);
}

int fail(const std::string& text) {
  rtpm::rt::print_error("cpp_servo", text);
  return 1;
}

}  // namespace

int main(int argc, char** argv) {
  std::string device = "lab/arm0";
  std::string registry{rtpm::names::kThisHost};
  rtpm::Duration duration = 10s;
  rtpm::rt::ThreadConfig thread{.name = "servo", .priority = 24000};
  rtpm::options::Options options("cpp_servo", "renders a virtual wall on a haptic device");
  options.add("device", device, "The device's name, or its URL");
  options.add("duration", duration, "How long to run, such as 10s");
  options.add_registry(registry);
  options.add_realtime(thread.realtime);
  if (const auto exit_code = options.parse(argc, argv)) return *exit_code;

  const rtpm::program::StopSignal stop;
  rtpm::rpc::Node node;
  rtpm::names::RegistryResolver resolver(node, registry);
  node.use(resolver);
  auto arm = rtpm::gvd::DeviceClient::open(node, device);
  if (!arm) return fail(arm.error().text());
  if (const auto acquired = arm->acquire(); !acquired)
    return fail(device + ": " + std::string(to_string(acquired.error())));
  if (const auto configured = rtpm::rt::configure_this_thread(thread); !configured)
    return fail(configured.error().text());

  Report report;
  int failed_count = 0;
  rtpm::rt::CycleTimer cycle(1ms);
  const rtpm::MonotonicTime end = cycle.due() + duration;
  for (; cycle.due() < end && !stop.is_requested(); cycle.finish()) {
    cycle.wait();
    const auto done = touch(*arm, report);
    failed_count = done ? 0 : failed_count + 1;
    // A call that comes too late costs a cycle. A refusal will not pass.
    if (!done &&
        (done.error().outcome() != DeviceOutcome::kCallFailed || failed_count > kFailedMax))
      return fail(device + ": " + std::string(to_string(done.error())));
  }
  std::printf("%d cycles, %d late; in the wall for %d, %.1f mm deep and %.2f N at most\n",
              report.cycle_count, static_cast<int>(cycle.overrun_count()), report.touch_count,
              1e3 * report.depth_m_max, report.force_newton_max);
  return 0;  // The device's client releases the lease, and the force ends.
}
