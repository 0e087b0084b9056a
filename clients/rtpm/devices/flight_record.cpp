#include <cstdio>
#include <string>

#include "cli/command.hpp"
#include "cli/output.hpp"
#include "devices/commands.hpp"
#include "devices/device.hpp"
#include "rtpm/base/printable.hpp"
#include "rtpm/capture/flight_file.hpp"
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

struct FlightRecordRequest {
  std::string device{};
  std::string file{};  ///< If empty, standard output.
};

int write_file(Context& context, const FlightRecordRequest& request, const gvd::FlightLog& log) {
  const auto written = capture::write_flight_file(request.file, request.device, log);
  if (!written) return context.fail(written.error());
  if (context.json) {
    print_json({{"file", request.file},
                {"device", request.device},
                {"number", log.number},
                {"cause", to_string(log.cause)},
                {"cycle", log.cycle},
                {"cycle_count", log.records.size()}});
  } else {
    print_line(printable(request.file, kShownWhole) + ": " + std::to_string(log.records.size()) +
               " cycles around " + std::string(to_string(log.cause)) + " in cycle " +
               std::to_string(log.cycle));
  }
  return kDone;
}

int flight_record(Context& context, const FlightRecordRequest& request) {
  const std::string& name = request.device;
  auto device = open_device(context, name);
  if (!device) return context.not_reached(device.error());
  const auto log = device->flight_record();
  if (!log) {
    return context.fail(name +
                        ": its flight record was not read: " + std::string(to_string(log.error())));
  }
  if (log->number == 0) {
    return context.fail(name +
                        ": has no flight record: there was no fault since its start, or it was a "
                        "moment ago; ask again in a second");
  }
  if (!request.file.empty()) return write_file(context, request, *log);
  if (context.json) {
    print_json(json_of(*log));
  } else {
    std::fputs(gvd::to_csv(*log).c_str(), stdout);
  }
  return kDone;
}

}  // namespace

void add_flight_record(CLI::App& program, Context& context) {
  const auto request = std::make_shared<FlightRecordRequest>();
  CLI::App& command = add_command(
      program, context, "flight-record",
      "Print or record the cycles around a device's newest fault",
      "  rtpm flight-record lab/arm0 > arm0.csv\n  rtpm flight-record lab/arm0 -o arm0.mcap\n"
      "CSV has a line for each cycle: what was measured, asked for, decided and applied. With -o, "
      "a\n"
      "recording in the format MCAP has a message for each, in the channel DEVICE/flight.\n",
      [request](Context& c) { return flight_record(c, *request); });
  add_target(command, request->device, "DEVICE");
  command
      .add_option("-o,--output", request->file, "Write a recording; the file must not exist yet")
      ->type_name("FILE");
}

}  // namespace rtpm::tool
