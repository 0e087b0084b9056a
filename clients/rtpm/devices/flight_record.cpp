#include <cstdio>
#include <string>

#include "cli/command.hpp"
#include "cli/output.hpp"
#include "devices/commands.hpp"
#include "rtpm/gvd/client.hpp"

namespace rtpm::tool {
namespace {

int flight_record(Context& context, const std::string& name) {
  gvd::DeviceClientOptions options;
  options.bind.deadline = context.deadline.value_or(options.bind.deadline);
  auto device = gvd::DeviceClient::open(context.node(), name, options);
  if (!device) return context.not_reached(named(name, device.error()));
  const auto log = device->flight_record();
  if (!log) {
    return context.fail(name +
                        ": its flight record was not read: " + std::string(to_string(log.error())));
  }
  if (log->number == 0) {
    return context.fail(name + ": has no flight record: there was no fault since its start");
  }
  std::fputs(gvd::to_csv(*log).c_str(), stdout);
  return kDone;
}

}  // namespace

void add_flight_record(CLI::App& program, Context& context) {
  const auto device = std::make_shared<std::string>();
  CLI::App& command = add_command(
      program, context, "flight-record", "Print the cycles around a device's newest fault as CSV",
      "  rtpm flight-record lab/arm0 > arm0.csv\n"
      "Each line is a cycle: what was measured, asked for, decided and applied.\n",
      [device](Context& c) { return flight_record(c, *device); });
  add_target(command, *device, "DEVICE");
}

}  // namespace rtpm::tool
