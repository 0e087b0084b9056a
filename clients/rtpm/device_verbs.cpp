#include "device_verbs.hpp"

#include <algorithm>
#include <array>
#include <cstdio>
#include <string>
#include <string_view>

#include "remote.hpp"
#include "rtpm/base/printable.hpp"
#include "rtpm/gvd/client.hpp"
#include "rtpm/names/directory.hpp"
#include "rtpm/options/stop_signal.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/log.hpp"

namespace rtpm::tool {
namespace {

constexpr std::string_view kDeviceInterface = "rtpm.device.Device";
constexpr Duration kRenewal = std::chrono::milliseconds{200};

int fail(const std::string& device, std::string_view text) {
  rt::print_error("rtpm", device + ": " + std::string(text));
  return 1;
}

struct Transition {
  std::string_view name{};
  gvd::DeviceResult (gvd::DeviceClient::*run)() = nullptr;
};
constexpr std::array kTransitions{Transition{"recover", &gvd::DeviceClient::recover},
                                  Transition{"activate", &gvd::DeviceClient::activate},
                                  Transition{"deactivate", &gvd::DeviceClient::deactivate},
                                  Transition{"rearm", &gvd::DeviceClient::rearm}};

std::string why_not(const gvd::DeviceClient& device, gvd::DeviceError error) {
  if (error == gvd::DeviceOutcome::kBelowOperatorPriority) {
    return "calls of a priority below " + std::to_string(device.operator_priority().value()) +
           " do not take the right to command over; give a higher --priority, or none";
  }
  return "was not taken over: " + std::string(to_string(error));
}

struct Scope {
  std::string_view name{};
  gvd::StopScope scope{};
  const char* what = "";
};
constexpr std::array kScopes{Scope{"device", gvd::StopScope::kDevice, ""},
                             Scope{"server", gvd::StopScope::kServer, ", and all of its server"},
                             Scope{"system", gvd::StopScope::kSystem, ", and all of its system"}};

bool stop_one(const Request& request, const std::string& name, gvd::StopScope scope) {
  gvd::DeviceClientOptions options;
  options.bind.deadline = request.options.deadline.value_or(options.bind.deadline);
  auto device = gvd::DeviceClient::open(request.node, name, options);
  if (!device) return fail(name, device.error().text()) == 0;
  if (const auto stopped = device->emergency_stop(scope); !stopped) {
    return fail(name, to_string(stopped.error())) == 0;
  }
  return true;
}

/// Asks all servers at the hub of the device's; false: it knows none.
bool tells_system(const Request& request, const std::string& name) {
  auto device = gvd::DeviceClient::open(request.node, name);
  return device && device->emergency_stop(gvd::StopScope::kSystem);
}

/// By both ways: the event of the system, and a call to each device, for those that no hub reaches.
int stop_all(const Request& request) {
  names::Directory directory(request.node, request.registry);
  const auto entries = directory.list();
  if (!entries) return fail("the system", entries.error().text());
  bool is_system_told = false;
  std::size_t device_count = 0;
  std::size_t stopped_count = 0;
  for (const names::NameEntry& entry : *entries) {
    if (entry.interface != kDeviceInterface) continue;
    ++device_count;
    if (!stop_one(request, entry.name, gvd::StopScope::kDevice)) continue;
    ++stopped_count;
    std::printf("%s is stopped\n", printable(entry.name).c_str());
    std::fflush(stdout);
    is_system_told = is_system_told || tells_system(request, entry.name);
  }
  if (device_count == 0) return fail("the system", "the registry names no device");
  std::printf("%zu of %zu devices are stopped%s\n", stopped_count, device_count,
              is_system_told ? ", and all others at their hub are told" : "");
  return stopped_count == device_count ? 0 : 1;
}

/// Keeps the lease for the requested time, or until the device ends it.
int hold(gvd::DeviceClient& device, const std::string& name, const Request& request,
         const options::StopSignal& stop) {
  const MonotonicTime until = request.stream_time ? rt::now() + *request.stream_time : kNever;
  while (rt::now() < until && !stop.wait_for(kRenewal)) {
    const auto renewed = device.renew();
    if (renewed) continue;
    const auto state = device.lease_state();
    if (renewed.error() != gvd::DeviceOutcome::kNotHolder || !state) {
      return fail(name, to_string(renewed.error()));
    }
    std::printf("%s is free: %.*s\n", name.c_str(), static_cast<int>(to_string(*state).size()),
                to_string(*state).data());
    return *state == gvd::LeaseState::kIdle ? 0 : 1;
  }
  if (const auto released = device.release(); !released) {
    return fail(name, to_string(released.error()));
  }
  std::printf("%s is free: the right to command was given back\n", name.c_str());
  return 0;
}

}  // namespace

int stop_devices(const Request& request) {
  if (request.arguments.empty()) return stop_all(request);
  const std::string& name = request.arguments[0];
  const std::string_view requested = request.arguments.size() > 1 ? request.arguments[1] : "device";
  const auto* const scope = std::ranges::find(kScopes, requested, &Scope::name);
  if (scope == kScopes.end()) {
    static_cast<void>(fail(name, "a stop is of the device, the server or the system"));
    return 2;
  }
  if (!stop_one(request, name, scope->scope)) return 1;
  std::printf("%s is stopped%s; `rtpm take-over %s rearm` ends that of a device\n",
              printable(name).c_str(), scope->what, printable(name).c_str());
  return 0;
}

int take_over(const Request& request) {
  const std::string& name = request.arguments[0];
  const std::string_view requested = request.arguments.size() > 1 ? request.arguments[1] : "";
  const auto* const transition = std::ranges::find(kTransitions, requested, &Transition::name);
  if (!requested.empty() && transition == kTransitions.end()) {
    static_cast<void>(fail(name, "a device makes recover, activate, deactivate or rearm"));
    return 2;
  }
  // Ctrl-C gives the lease back from here on.
  const options::StopSignal stop;
  gvd::DeviceClientOptions options;
  options.bind.deadline = request.options.deadline.value_or(options.bind.deadline);
  auto device = gvd::DeviceClient::open(request.node, name, options);
  if (!device) return fail(name, device.error().text());
  const bool has_priority = request.options.priority && *request.options.priority > Priority{0};
  const Priority priority = has_priority ? *request.options.priority : device->operator_priority();
  if (const auto taken = device->take_over(priority); !taken) {
    return fail(name, why_not(*device, taken.error()));
  }
  std::printf("%s was taken over: no client commands it, its force goes to zero\n", name.c_str());
  std::fflush(stdout);
  if (transition != kTransitions.end()) {
    if (const auto done = ((*device).*(transition->run))(); !done) {
      return fail(name, std::string(requested) + ": " + std::string(to_string(done.error())));
    }
  }
  return hold(*device, name, request, stop);
}

int flight_record(const Request& request) {
  const std::string& name = request.arguments[0];
  gvd::DeviceClientOptions options;
  options.bind.deadline = request.options.deadline.value_or(options.bind.deadline);
  auto device = gvd::DeviceClient::open(request.node, name, options);
  if (!device) return fail(name, device.error().text());
  const auto log = device->flight_record();
  if (!log)
    return fail(name, "its flight record was not read: " + std::string(to_string(log.error())));
  if (log->number == 0)
    return fail(name, "has no flight record: there was no fault since its start");
  std::fputs(gvd::to_csv(*log).c_str(), stdout);
  return 0;
}

}  // namespace rtpm::tool
