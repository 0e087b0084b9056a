#include <algorithm>
#include <cstdint>
#include <ctime>
#include <string>
#include <vector>

#include "cli/command.hpp"
#include "cli/output.hpp"
#include "cli/table.hpp"
#include "events/commands.hpp"
#include "rtpm/base/nesting.hpp"
#include "rtpm/incidents/file.hpp"
#include "rtpm/program/text.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/log.hpp"
#include "rtpm/rt/utc.hpp"

namespace rtpm::tool {
namespace {

using incidents::Incident;
using program::formatted;

struct IncidentsRequest {
  std::string action{};
  std::vector<std::uint64_t> ids{};
  bool takes_all = false;
  std::string person{};
  bool is_open = false;
  bool is_csv = false;
  std::string file{};
};

/// A time in UTC; empty for 0.
std::string time_text(std::uint64_t ns) {
  if (ns == 0) return {};
  const auto whole_s = static_cast<std::time_t>(ns / 1'000'000'000);
  std::tm utc{};
  ::gmtime_r(&whole_s, &utc);
  return formatted("%04d-%02d-%02dT%02d:%02d:%02d.%03dZ", utc.tm_year + 1900, utc.tm_mon + 1,
                   utc.tm_mday, utc.tm_hour, utc.tm_min, utc.tm_sec,
                   static_cast<int>(ns / 1'000'000 % 1000));
}

double seconds_of(const Incident& incident) {
  return static_cast<double>(incident.until_ns - incident.since_ns) / 1e9;
}

/// A cell of a CSV file; a spreadsheet takes none for a formula.
std::string cell(std::string text) {
  if (!text.empty() && std::string_view("=+-@").find(text.front()) != std::string_view::npos) {
    text.insert(0, "'");
  }
  if (text.find_first_of(",\"\n\r") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char c : text)
    quoted += c == '"' ? "\"\"" : std::string(1, c);
  return quoted + "\"";
}

void print_csv(const std::vector<Incident>& list) {
  std::string text =
      "id,severity,who,what,why,since,until,seconds,count,acknowledged by,acknowledged,"
      "recording\r\n";
  for (const Incident& one : list) {
    text += std::to_string(one.id) + "," + std::string(to_string(one.severity)) + "," +
            cell(one.who) + "," + cell(one.what) + "," + cell(one.why) + "," +
            time_text(one.since_ns) + "," + time_text(one.until_ns) + "," +
            (one.is_open() ? "" : formatted("%.3f", seconds_of(one))) + "," +
            std::to_string(one.count) + "," + cell(one.acknowledged_by) + "," +
            time_text(one.acknowledged_ns) + "," + cell(one.recording) + "\r\n";
  }
  text.resize(text.size() - 1);
  print_line(text);
}

void print_table(const std::vector<Incident>& list) {
  std::vector<Row> rows{{"ID", "SEVERITY", "WHO", "WHAT", "SINCE", "LASTED", "SEEN BY", "WHY"}};
  for (const Incident& one : list) {
    const std::string count =
        one.count > 1 ? formatted(" x%llu", static_cast<unsigned long long>(one.count)) : "";
    rows.push_back({std::to_string(one.id), std::string(to_string(one.severity)), one.who,
                    one.what + count, time_text(one.since_ns),
                    one.is_open() ? "it lasts" : formatted("%.1f s", seconds_of(one)),
                    one.is_acknowledged() ? one.acknowledged_by : "-", one.why});
  }
  std::string text = aligned(rows, rows.front().size());
  if (text.ends_with('\n')) text.pop_back();
  print_line(text);
}

int show(Context& context, const IncidentsRequest& request) {
  auto content = incidents::read_file(request.file);
  if (!content) return context.fail(content.error());
  if (request.is_open) {
    std::erase_if(content->incidents, [](const Incident& one) { return !one.is_open(); });
  }
  if (content->torn_count > 0) {
    rt::print_error("rtpm", std::to_string(content->torn_count) +
                                " lines of the file could not be read, and are left out");
  }
  if (context.json) {
    Json list = Json::array();
    for (const Incident& one : content->incidents)
      list.push_back(parse_bounded_json<Json>(incidents::to_json(one)));
    print_json({{"incidents", std::move(list)}, {"torn_count", content->torn_count}});
  } else if (request.is_csv) {
    print_csv(content->incidents);
  } else if (content->incidents.empty()) {
    print_line(request.is_open ? "no incident lasts" : "no incident so far");
  } else {
    print_table(content->incidents);
  }
  return kDone;
}

int acknowledge(Context& context, IncidentsRequest request) {
  if (request.person.empty()) {
    return context.fail("an acknowledgement has a name: --as NAME is missing", kMisused);
  }
  if (request.ids.empty() && !request.takes_all) {
    return context.fail("nothing to acknowledge: an ID or --all is missing", kMisused);
  }
  const auto content = incidents::read_file(request.file);
  if (!content) return context.fail(content.error());
  for (const std::uint64_t id : request.ids) {
    if (std::ranges::count(content->incidents, id, &Incident::id) > 0) continue;
    return context.fail("there is no incident " + std::to_string(id) + "; nothing was changed");
  }
  std::vector<std::uint64_t> ids;
  for (const Incident& one : content->incidents) {
    const bool is_meant = request.takes_all || std::ranges::count(request.ids, one.id) > 0;
    if (is_meant && !one.is_acknowledged()) ids.push_back(one.id);
  }
  if (!ids.empty()) {
    const auto done =
        incidents::acknowledge_in_file(request.file, ids, request.person, rt::utc_ns(rt::now()));
    if (!done) return context.fail(done.error());
  }
  if (context.json) {
    print_json({{"acknowledged", ids}});
  } else {
    print_line(std::to_string(ids.size()) + (ids.size() == 1 ? " incident is" : " incidents are") +
               " acknowledged");
  }
  return kDone;
}

int run(Context& context, IncidentsRequest request) {
  if (request.file.empty()) request.file = incidents::default_file();
  if (request.file.empty()) {
    return context.fail("the environment names no folder for incidents; give --file FILE");
  }
  return request.action.empty() ? show(context, request) : acknowledge(context, std::move(request));
}

}  // namespace

void add_incidents(CLI::App& program, Context& context) {
  const auto request = std::make_shared<IncidentsRequest>();
  CLI::App& command = add_command(program, context, "incidents",
                                  "Show what went wrong, as rtpm-console has noticed it",
                                  "  rtpm incidents --open\n"
                                  "  rtpm incidents --csv > incidents.csv\n"
                                  "  rtpm incidents acknowledge 7 8 --as Anna\n"
                                  "Reads the file of the rtpm-console of this user and host, "
                                  "whether it runs or not. A console\n"
                                  "that runs shows an acknowledgement within a second.\n",
                                  [request](Context& c) { return run(c, *request); });
  command.add_option("ACTION", request->action, "acknowledge, or none")
      ->check(CLI::IsMember({"acknowledge"}))
      ->type_name("");
  command.add_option("ID", request->ids, "Incidents, by number")->type_name("");
  command.add_flag("--all", request->takes_all, "Acknowledge all");
  command.add_option("--as", request->person, "The name of the person who acknowledges")
      ->type_name("NAME");
  command.add_flag("--open", request->is_open, "Only those that last");
  command.add_flag("--csv", request->is_csv, "As a table for spreadsheets");
  command
      .add_option("--file", request->file, "The file; default: ~/.local/state/rtpm/incidents.jsonl")
      ->type_name("FILE");
}

}  // namespace rtpm::tool
