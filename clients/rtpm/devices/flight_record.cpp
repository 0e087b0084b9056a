#include <cstdio>
#include <string>

#include "cli/command.hpp"
#include "cli/output.hpp"
#include "devices/commands.hpp"
#include "rtpm/gvd/client.hpp"

namespace rtpm::tool {
namespace {

Json json_of(const driver::Vector3& vector) {
  return {vector.x, vector.y, vector.z};
}
Json json_of(const driver::Wrench& wrench) {
  return {{"force_newton", json_of(wrench.force_newton)},
          {"torque_newton_metre", json_of(wrench.torque_newton_metre)}};
}

Json json_of(const gvd::FlightLog& log) {
  Json cycles = Json::array();
  for (const gvd::FlightRecord& record : log.records) {
    cycles.push_back({{"cycle", record.cycle},
                      {"time_ns", to_ns(record.time)},
                      {"has_command", record.has_command},
                      {"gain", record.gain},
                      {"heat", record.heat},
                      {"energy_joule", record.energy_joule},
                      {"position_m", json_of(record.position_m)},
                      {"velocity_m_per_s", json_of(record.velocity_m_per_s)},
                      {"received", json_of(record.received)},
                      {"applied", json_of(record.applied)},
                      {"faults", driver::to_text(record.faults)}});
  }
  return {{"number", log.number},
          {"cause", to_string(log.cause)},
          {"cycle", log.cycle},
          {"cycles", std::move(cycles)}};
}

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
  if (context.json) {
    print_json(json_of(*log));
  } else {
    std::fputs(gvd::to_csv(*log).c_str(), stdout);
  }
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
