#include <algorithm>
#include <cstdio>
#include <iterator>

#include "cli/command.hpp"
#include "cli/output.hpp"
#include "cli/progress.hpp"
#include "host/commands.hpp"
#include "host/discovery.hpp"
#include "host/finding_text.hpp"
#include "host/keys.hpp"
#include "host/latency.hpp"
#include "host/network.hpp"
#include "host/peers.hpp"
#include "host/wake_up.hpp"
#include "rtpm/program/duration.hpp"
#include "rtpm/rpc/lane_table.hpp"
#include "rtpm/rt/survey.hpp"

namespace rtpm::tool {
namespace {

using rt::Finding;
using rt::Severity;

struct DoctorRequest {
  bool is_quick = false;
  bool shows_all = false;
  bool fixes = false;
  bool is_dry = false;
  std::string latency_device{};  ///< If set, only its latency is measured.
  Duration time = std::chrono::seconds{2};
};

std::vector<int> processes_with_lanes() {
  std::vector<int> ids;
  for (const rpc::LaneTable& table : rpc::LaneTable::find()) {
    if (table.is_alive()) ids.push_back(table.process_id());
  }
  return ids;
}

std::vector<Finding> survey(Context& context) {
  std::vector<Finding> findings = rt::survey_host(processes_with_lanes());
  std::ranges::move(survey_network(context), std::back_inserter(findings));
  std::ranges::move(survey_keys(context), std::back_inserter(findings));
  std::ranges::move(survey_open_servers(), std::back_inserter(findings));
  std::ranges::move(survey_discovery(context), std::back_inserter(findings));
  std::ranges::move(survey_peers(context), std::back_inserter(findings));
  return findings;
}

/// Applies the remedies that can be applied automatically, and judges the host again.
void fix(FindingReport& report) {
  std::vector<std::string> ids;
  for (const Finding& finding : report.findings) {
    bool is_changed = false;
    for (const rt::Setting& setting : finding.fixes) {
      const auto change = rt::apply(setting, report.is_dry);
      if (!change) continue;
      is_changed |= change->problem.empty();
      report.changes.push_back(*change);
    }
    if (!is_changed) continue;
    ids.push_back(finding.id);
    report.lastings.push_back(finding.lasting);
  }
  if (report.is_dry || ids.empty()) return;
  for (const Finding& now : rt::survey_host(processes_with_lanes())) {
    const auto before = std::ranges::find(report.findings, now.id, &Finding::id);
    if (before == report.findings.end() || std::ranges::find(ids, now.id) == ids.end()) continue;
    if (now.severity < before->severity) report.fixed_ids.push_back(now.id);
    *before = now;
  }
}

int doctor(Context& context, const DoctorRequest& request) {
  const program::StopSignal& stop = context.stop();
  FindingReport report{.is_dry = request.is_dry};
  {
    const WaitLine line(context, "looking at this host, its network and the servers");
    report.findings = survey(context);
  }
  if (request.fixes) fix(report);
  Json json = Json::object();
  std::string measured;
  if (!request.is_quick) {
    const WaitLine line(context, "measuring wake-ups for " + program::duration_text(request.time),
                        Duration{0});
    const auto wake_ups = measure_wake_ups(request.time, stop);
    if (!wake_ups) return context.fail(wake_ups.error());
    json["wake_ups"] = rtpm::tool::json_of(*wake_ups);
    report.findings.push_back(judge(*wake_ups));
    measured = "\n" + text_of(*wake_ups);
  }
  json["findings"] = json_of_findings(report);
  if (request.fixes) json["changes"] = json_of_changes(report);
  if (!context.json) {
    std::string text = text_of(report.findings, request.shows_all, terminal_width());
    if (request.fixes) text += "\n" + text_of_changes(report);
    std::fputs((text + measured).c_str(), stdout);
  }
  const bool is_fit = std::ranges::find(report.findings, Severity::kProblem, &Finding::severity) ==
                      report.findings.end();
  const bool is_changed = std::ranges::all_of(
      report.changes, [](const rt::Change& change) { return change.problem.empty(); });
  json["is_fit"] = is_fit;
  if (context.json) print_json(json);
  return is_fit && is_changed ? kDone : kFailed;
}

}  // namespace

void add_doctor(CLI::App& program, Context& context) {
  const auto request = std::make_shared<DoctorRequest>();
  CLI::App& command = add_command(
      program, context, "doctor", "Judge this host, and the servers it reaches, for real time",
      "  rtpm doctor --quick\n  sudo rtpm doctor --fix --dry-run\n"
      "Says what is wrong with this host, its network and the registry's servers, what each costs\n"
      "and the remedy, the worst first; then measures how late a thread wakes, and judges that.\n"
      "--fix sets what is safe and can be taken back: socket buffers, CPU governor, huge pages,\n"
      "until the host starts anew. The exit code is 1 if there is a problem, or --fix could not\n"
      "set something; warnings and notes leave it 0.\n"
      "--latency sets each output of a device 15 times, waits for the device's sensor that "
      "follows,\n"
      "such as a photodiode before a lamp or a screen, and says how long that takes. Recordings "
      "by\n"
      "`rtpm record` on this host then have the figures.\n",
      [request](Context& c) {
        if (!request->latency_device.empty()) return measure_latency(c, request->latency_device);
        return doctor(c, *request);
      });
  command.add_flag("--quick", request->is_quick, "Measure nothing");
  command.add_flag("--all", request->shows_all, "Show what is good in a line each");
  command
      .add_option("--latency", request->latency_device,
                  "Only measure how long a stimulus of this device takes to its sample")
      ->type_name("DEVICE");
  CLI::Option* const fix = command.add_flag("--fix", request->fixes,
                                            "Set what is safe and can be taken back; needs root");
  command.add_flag("--dry-run", request->is_dry, "With --fix: only print what it would set")
      ->needs(fix);
  add_duration(command, "--time", request->time, "How long to measure",
               {std::chrono::milliseconds{10}, std::chrono::hours{24}});
}

}  // namespace rtpm::tool
