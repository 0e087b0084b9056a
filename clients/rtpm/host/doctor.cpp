#include <algorithm>
#include <cstdio>

#include "cli/command.hpp"
#include "cli/output.hpp"
#include "host/commands.hpp"
#include "host/peers.hpp"
#include "host/wake_up.hpp"
#include "rtpm/rt/report.hpp"

namespace rtpm::tool {
namespace {

using rt::SetupNote;

struct DoctorRequest {
  bool is_quick = false;
  Duration time = std::chrono::seconds{2};
};

Json json_of(const std::vector<SetupNote>& notes) {
  Json list = Json::array();
  for (const SetupNote& note : notes) {
    list.push_back({{"subject", note.subject},
                    {"grant", to_string(note.grant)},
                    {"text", note.text},
                    {"remedy", note.remedy}});
  }
  return list;
}

int doctor(Context& context, const DoctorRequest& request) {
  const options::StopSignal& stop = context.stop();
  std::vector<SetupNote> notes = rt::survey_host();
  std::ranges::move(survey_peers(context), std::back_inserter(notes));
  Json json{{"notes", json_of(notes)}};
  if (!context.json) std::fputs(rt::to_text(notes).c_str(), stdout);
  if (!request.is_quick) {
    std::fflush(stdout);
    const auto wake_ups = measure_wake_ups(request.time, stop);
    if (!wake_ups) return context.fail(wake_ups.error());
    json["wake_ups"] = rtpm::tool::json_of(*wake_ups);
    if (!context.json) std::fputs(("\n" + text_of(*wake_ups)).c_str(), stdout);
  }
  const bool is_refused = std::ranges::any_of(
      notes, [](const SetupNote& note) { return note.grant == rt::Grant::kRefused; });
  json["is_fit"] = !is_refused;
  if (context.json) print_json(json);
  return is_refused ? kFailed : kDone;
}

}  // namespace

void add_doctor(CLI::App& program, Context& context) {
  const auto request = std::make_shared<DoctorRequest>();
  CLI::App& command = add_command(
      program, context, "doctor", "Judge this host, and the servers it reaches, for real time",
      "  rtpm doctor --quick\n"
      "Says what the host gives, what each lack costs and its remedy; whether the registry's\n"
      "servers answer and have schemas in common; and measures how late a thread wakes. The exit\n"
      "code is 1 if something is refused.\n",
      [request](Context& c) { return doctor(c, *request); });
  command.add_flag("--quick", request->is_quick, "Measure nothing");
  add_duration(command, "--time", request->time, "How long to measure",
               {std::chrono::milliseconds{10}, std::chrono::hours{24}});
}

}  // namespace rtpm::tool
