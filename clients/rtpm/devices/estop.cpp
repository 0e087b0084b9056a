#include <algorithm>
#include <array>
#include <string>
#include <string_view>

#include "cli/command.hpp"
#include "cli/output.hpp"
#include "devices/commands.hpp"
#include "devices/device.hpp"
#include "devices/device_names.hpp"
#include "rtpm/base/printable.hpp"
#include "rtpm/gvd/client.hpp"
#include "rtpm/names/directory.hpp"

namespace rtpm::tool {
namespace {

struct EstopRequest {
  std::string device{};
  std::string scope = "device";
};

struct Scope {
  std::string_view name{};
  gvd::StopScope scope{};
  const char* what = "";
};
constexpr std::array kScopes{Scope{"device", gvd::StopScope::kDevice, ""},
                             Scope{"server", gvd::StopScope::kServer, ", and all of its server"},
                             Scope{"system", gvd::StopScope::kSystem, ", and all of its system"}};

/// @return the exit code; it has said why it is not kDone
int stop_one(Context& context, const std::string& name, gvd::StopScope scope) {
  auto device = open_device(context, name);
  if (!device) return context.not_reached(device.error());
  if (const auto stopped = device->emergency_stop(scope); !stopped) {
    return context.fail({name, std::string(to_string(stopped.error()))});
  }
  return kDone;
}

/// Asks all servers at the hub of the device's; false: it knows none.
bool tells_system(Context& context, const std::string& name) {
  auto device = gvd::DeviceClient::open(context.node(), name);
  return device && device->emergency_stop(gvd::StopScope::kSystem);
}

void tell_stopped(const Context& context, const std::string& name, const std::string& sentence) {
  if (context.json) {
    print_json({{"device", name}, {"is_stopped", true}});
  } else {
    print_line(printable(name) + " is stopped" + sentence);
  }
}

/// By both ways: the event of the system, and a call to each device, for those that no hub reaches.
int stop_all(Context& context) {
  const auto entries = names::Directory(context.node(), context.registry).list();
  if (!entries) return context.not_reached(named("the system", entries.error()));
  bool is_system_told = false;
  std::size_t device_count = 0;
  std::size_t stopped_count = 0;
  for (const names::NameEntry& entry : *entries) {
    if (entry.interface != kDeviceInterface) continue;
    ++device_count;
    if (stop_one(context, entry.name, gvd::StopScope::kDevice) != kDone) continue;
    ++stopped_count;
    tell_stopped(context, entry.name, "");
    is_system_told = is_system_told || tells_system(context, entry.name);
  }
  if (device_count == 0) return context.fail("the system: the registry names no device");
  if (!context.json) {
    print_line(std::to_string(stopped_count) + " of " + std::to_string(device_count) +
               " devices are stopped" +
               (is_system_told ? ", and all others at their hub are told" : ""));
  }
  return stopped_count == device_count ? kDone : kFailed;
}

int estop(Context& context, const EstopRequest& request) {
  if (request.device.empty()) return stop_all(context);
  const auto* const scope = std::ranges::find(kScopes, request.scope, &Scope::name);
  if (const int code = stop_one(context, request.device, scope->scope); code != kDone) return code;
  tell_stopped(context, request.device,
               std::string(scope->what) + "; `rtpm take-over " + printable(request.device) +
                   " rearm` ends that of a device");
  return kDone;
}

}  // namespace

void add_estop(CLI::App& program, Context& context) {
  const auto request = std::make_shared<EstopRequest>();
  CLI::App& command = add_command(
      program, context, "estop", "Emergency stop: take the force of devices away at once",
      "  rtpm estop                    every device that the registry names, and all others of\n"
      "                                their system\n"
      "  rtpm estop lab/arm0 server    this one, and all of its server\n"
      "Needs no right to command. They stay stopped until `rtpm take-over DEVICE rearm`.\n",
      [request](Context& c) { return estop(c, *request); });
  add_target(command, request->device, "DEVICE").required(false);
  command.add_option("SCOPE", request->scope, "device, server or system")
      ->check(CLI::IsMember({"device", "server", "system"}))
      ->capture_default_str()
      ->type_name("");
}

}  // namespace rtpm::tool
