// Bilateral coupling: a spring and a damper tie two arms together. The hand at the first one moves
// the second one, and feels it. First, in another terminal: rtpm up examples/laboratory.toml
//
//     two_arms --duration 10s
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <string>

#include "rtpm/driver/vector.hpp"
#include "rtpm/gvd/client.hpp"
#include "rtpm/names/resolver.hpp"
#include "rtpm/options/options.hpp"
#include "rtpm/program/stop_signal.hpp"
#include "rtpm/rpc/node.hpp"
#include "rtpm/rt/cycle_timer.hpp"
#include "rtpm/rt/log.hpp"

namespace {

using namespace std::chrono_literals;
using rtpm::driver::Sample;
using rtpm::driver::Vector3;
using rtpm::gvd::DeviceClient;

constexpr double kStiffnessNewtonPerM = 500;
constexpr double kDampingNewtonSPerM = 2;
constexpr int kFailedMax = 1000;          // In a row; then an arm counts as lost.
constexpr rtpm::Duration kSettling = 1s;  // The force begins softly, so the arms meet slowly.

int fail(const std::string& text) {
  rtpm::rt::print_error("two_arms", text);
  return 1;
}

/// The force that pulls `here` towards `there`.
Vector3 coupling_newton(const Sample& here, const Sample& there) {
  const Vector3 apart_m = difference(there.pose.position_m, here.pose.position_m);
  const Vector3 apart_m_per_s = difference(there.twist.linear_m_per_s, here.twist.linear_m_per_s);
  return sum(scaled(apart_m, kStiffnessNewtonPerM), scaled(apart_m_per_s, kDampingNewtonSPerM));
}

rtpm::expected<DeviceClient, rtpm::SetupError> open(rtpm::rpc::Node& node, std::string_view name) {
  auto arm = DeviceClient::open(node, name);
  if (!arm) return arm;
  const auto acquired = arm->acquire();
  if (acquired) return arm;
  return rtpm::setup_error(std::string(name), std::string(to_string(acquired.error())));
}

}  // namespace

int main(int argc, char** argv) {
  std::string registry{rtpm::names::kThisHost};
  rtpm::Duration duration = 10s;
  rtpm::rt::ThreadConfig thread{.name = "coupling", .priority = 24000};
  rtpm::options::Options options("two_arms", "couples lab/arm0 and lab/arm1");
  options.add("duration", duration, "How long to run, such as 10s");
  options.add_registry(registry);
  options.add_realtime(thread.realtime);
  if (const auto exit_code = options.parse(argc, argv)) return *exit_code;

  const rtpm::program::StopSignal stop;
  rtpm::rpc::Node node;
  rtpm::names::RegistryResolver resolver(node, registry);
  node.use(resolver);
  auto first = open(node, "lab/arm0");
  if (!first) return fail(first.error().text());
  auto second = open(node, "lab/arm1");
  if (!second) return fail(second.error().text());
  if (const auto configured = rtpm::rt::configure_this_thread(thread); !configured)
    return fail(configured.error().text());

  const rtpm::rpc::CallOptions call{.priority = 24000, .deadline = 800us};
  int failed_count = 0;
  double apart_m_max = 0, way_m = 0;  // The way is that of the second arm from the origin.
  rtpm::rt::CycleTimer cycle(1ms);
  const rtpm::MonotonicTime begin = cycle.due();
  for (; cycle.due() < begin + duration && !stop.is_requested(); cycle.finish()) {
    cycle.wait();
    const auto here = first->read(call);
    const auto there = second->read(call);
    // A late call costs a cycle: without a newer one, a command lasts for ten.
    failed_count = here && there ? 0 : failed_count + 1;
    if (failed_count > kFailedMax) return fail("an arm does not answer any more");
    if (failed_count > 0) continue;
    const Vector3 force_newton = coupling_newton(*here, *there);
    auto sent = first->set_force(force_newton, call);
    if (sent) sent = second->set_force(scaled(force_newton, -1), call);
    if (!sent && sent.error().outcome() != rtpm::gvd::DeviceOutcome::kCallFailed)
      return fail("an arm refuses its force: " + std::string(to_string(sent.error())));
    if (cycle.due() < begin + kSettling) continue;
    const Vector3 apart_m = difference(here->pose.position_m, there->pose.position_m);
    apart_m_max = std::max(apart_m_max, length(apart_m));
    way_m = std::max(way_m, length(there->pose.position_m));
  }
  std::printf("lab/arm1 moved %.1f mm away from the origin, and %.1f mm from lab/arm0 at most\n",
              1e3 * way_m, 1e3 * apart_m_max);
  return 0;
}
