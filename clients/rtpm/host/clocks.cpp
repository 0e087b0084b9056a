#include <algorithm>
#include <string>
#include <vector>

#include "cli/command.hpp"
#include "cli/output.hpp"
#include "cli/progress.hpp"
#include "cli/table.hpp"
#include "host/commands.hpp"
#include "objects/unbound.hpp"
#include "rtpm/base/printable.hpp"
#include "rtpm/capture/clock_survey.hpp"
#include "rtpm/names/directory.hpp"
#include "rtpm/program/duration.hpp"
#include "rtpm/program/text.hpp"
#include "rtpm/rt/clock.hpp"

namespace rtpm::tool {
namespace {

using program::formatted;

constexpr Duration kSurveyPeriod = std::chrono::milliseconds{100};

struct ClocksRequest {
  std::vector<std::string> targets{};
  Duration time = std::chrono::seconds{3};
};

double clock_us(Duration duration) {
  return std::chrono::duration<double, std::micro>(duration).count();
}

/// Adds the servers of the targets, or of all names.
/// @return kDone, or the exit code of the reported error
int add_servers(Context& context, const ClocksRequest& request, capture::ClockSurvey& survey) {
  for (const std::string& target : request.targets) {
    const auto url = names::url_of(context.node(), context.registry, target);
    if (!url) return context.not_reached(url.error());
    survey.add(target, *url);
  }
  if (!request.targets.empty()) return kDone;
  const auto entries = names::Directory(context.node(), context.registry).list();
  if (!entries) return context.not_reached(entries.error());
  for (const names::NameEntry& entry : *entries)
    survey.add(entry.name, entry.url);
  return kDone;
}

std::string server_names(const capture::ServerClock& one) {
  constexpr std::size_t kShownCountMax = 4;
  std::string text;
  for (std::size_t i = 0; i < std::min(one.names.size(), kShownCountMax); ++i)
    text += (i > 0 ? ", " : "") + printable(one.names[i]);
  if (one.names.size() > kShownCountMax) {
    text += " and " + std::to_string(one.names.size() - kShownCountMax) + " more";
  }
  return text;
}

std::string clocks_text(const capture::ClockSurvey& survey) {
  if (survey.clocks().empty()) return "there are no servers";
  std::vector<Row> rows{{"SERVER", "NAMES", "OFFSET-US", "±US", "DRIFT-PPM", "TRIP-US"}};
  std::string problems;
  for (const capture::ServerClock& one : survey.clocks()) {
    Row row{printable(one.server), server_names(one), "unknown", "-", "-", "-"};
    if (one.clock) {
      row[2] = formatted("%+.1f", clock_us(one.clock->offset));
      row[3] = formatted("%.1f", clock_us(one.clock->uncertainty));
      if (one.clock->drift_ppm != 0) row[4] = formatted("%+.1f", one.clock->drift_ppm);
      row[5] = formatted("%.1f", clock_us(one.trip));
    }
    if (!one.problem.empty()) {
      problems += "\n" + printable(one.server) + ": " + printable(one.problem);
    }
    rows.push_back(std::move(row));
  }
  std::string text = aligned(rows, 2) + problems;
  while (text.ends_with('\n'))
    text.pop_back();
  return text;
}

Json clocks_json(const capture::ClockSurvey& survey) {
  Json list = Json::array();
  for (const capture::ServerClock& one : survey.clocks()) {
    Json json{{"server", one.server}, {"names", one.names}};
    if (one.clock) {
      json["offset_us"] = clock_us(one.clock->offset);
      json["uncertainty_us"] = clock_us(one.clock->uncertainty);
      if (one.clock->drift_ppm != 0) json["drift_ppm"] = one.clock->drift_ppm;
      json["trip_us"] = clock_us(one.trip);
    }
    if (!one.problem.empty()) json["problem"] = one.problem;
    list.push_back(std::move(json));
  }
  return {{"clocks", std::move(list)}};
}

int clocks(Context& context, const ClocksRequest& request) {
  const program::StopSignal& stop = context.stop();
  capture::ClockSurvey survey(context.node(),
                              context.deadline.value_or(std::chrono::milliseconds{100}));
  if (const int exit_code = add_servers(context, request, survey); exit_code != kDone) {
    return exit_code;
  }
  {
    const WaitLine line(context, "comparing clocks for " + program::duration_text(request.time),
                        Duration{0});
    const MonotonicTime end = rt::now() + request.time;
    do {
      survey.measure();
    } while (!stop.wait_for(std::min(kSurveyPeriod, end - rt::now())) && rt::now() < end);
  }
  if (context.json) {
    print_json(clocks_json(survey));
  } else {
    print_line(clocks_text(survey));
  }
  const bool are_known = std::ranges::all_of(
      survey.clocks(), [](const capture::ServerClock& one) { return one.clock.has_value(); });
  return are_known ? kDone : kFailed;
}

}  // namespace

void add_clocks(CLI::App& program, Context& context) {
  const auto request = std::make_shared<ClocksRequest>();
  CLI::App& command = add_command(
      program, context, "clocks", "Compare the clocks of all servers with this host's",
      "  rtpm clocks\n  rtpm clocks lab/arm0 lab/eeg0 --for 20s\n"
      "Of each server: its clock minus ours in microseconds, the bound of that figure's error, "
      "how\n"
      "many microseconds it gains per second, and the shortest way there and back, which bounds "
      "the\n"
      "error. The drift takes a few seconds; '-' is not known yet. Programs on one host have one\n"
      "clock: their offset is 0 within the bound. `rtpm record` writes the same figures into each\n"
      "recording. The exit code is 1 if a server did not answer.\n",
      [request](Context& c) { return clocks(c, *request); });
  command.add_option("TARGETS", request->targets, "Names or URLs; without: all names")
      ->type_name("");
  add_duration(command, "--for", request->time, "How long to compare",
               {std::chrono::milliseconds{1}, std::chrono::hours{1}});
}

}  // namespace rtpm::tool
