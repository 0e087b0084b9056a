#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "cli/command.hpp"
#include "cli/output.hpp"
#include "cli/table.hpp"
#include "host/commands.hpp"
#include "host/lane_text.hpp"
#include "rtpm/base/printable.hpp"
#include "rtpm/rpc/lane_table.hpp"
#include "rtpm/rt/clock.hpp"

namespace rtpm::tool {
namespace {

constexpr Duration kWatchInterval = std::chrono::seconds{1};

const Row kHead{"PROCESS", "SERVER", "LANE",    "BAND", "WAIT",   "CALLS", "PER-S", "LONGEST",
                "QUEUE",   "OPEN",   "DROPPED", "LATE", "COPIES", "RESTS", "RUNS",  "FOR"};

/// A lane's previous call count, for its rate.
struct Earlier {
  MonotonicTime when{};
  std::uint64_t call_count = 0;
};
using History = std::map<std::pair<int, std::string>, Earlier>;

std::string rate_of(const rpc::LaneTable& table, const rpc::LaneReading& lane,
                    std::uint64_t call_count, History& history) {
  const MonotonicTime now = rt::now();
  const std::string which = std::to_string(table.port()) + "/" + lane.name;
  Earlier& earlier = history[{table.process_id(), which}];
  const Earlier before = std::exchange(earlier, {now, call_count});
  if (before.when == MonotonicTime{} || call_count < before.call_count) return "-";
  const double seconds = std::chrono::duration<double>(now - before.when).count();
  const double rate = static_cast<double>(call_count - before.call_count) / seconds;
  return std::to_string(static_cast<std::uint64_t>(rate + 0.5));
}

Row row_of(const rpc::LaneTable& table, const rpc::LaneReading& lane, History& history) {
  const rpc::LaneSample sample = lane.sample.value_or(rpc::LaneSample{});
  const rpc::ServerCounters& counters = sample.counters;
  const std::int64_t busy_ns =
      lane.busy_since == MonotonicTime{} ? 0 : (rt::now() - lane.busy_since).count();
  const std::string band = std::to_string(lane.band_low) + "-" + std::to_string(lane.band_high);
  const bool is_shared = lane.schedule == "time-shared";
  return {std::to_string(table.process_id()),
          server_text(table),
          printable(lane.name),
          band,
          printable(lane.wait) + (is_shared ? ",shared" : ""),
          std::to_string(counters.call_count),
          rate_of(table, lane, counters.call_count, history),
          time_text(sample.longest_cycle_ns),
          std::to_string(sample.queued_count),
          std::to_string(sample.open_call_count),
          std::to_string(dropped_count(counters.frames)),
          std::to_string(counters.late_count),
          std::to_string(counters.frames.duplicate_answered_count +
                         counters.frames.dropped_for(wire::DropReason::kDuplicateRunning)),
          std::to_string(sample.pause_count),
          std::to_string(lane.busy_count),
          busy_ns > 0 ? time_text(busy_ns) : "-"};
}

/// Details below the table: why frames were dropped and calls failed.
std::string remarks_of(const rpc::LaneReading& lane) {
  if (!lane.sample) return {};
  std::string text;
  const auto add = [&](std::string_view what, std::uint64_t count) {
    if (count > 0) text.append(" ").append(what).append("=").append(std::to_string(count));
  };
  const rpc::ServerCounters& counters = lane.sample->counters;
  for (std::size_t i = 0; i < wire::kDropReasonCount; ++i)
    add(to_string(static_cast<wire::DropReason>(i)), counters.frames.dropped[i]);
  add("refused", counters.frames.refused_count);
  add("overload", counters.overload_count);
  add("borrowed", counters.borrowed_count);
  add("queued_max", counters.queued_count_max);
  add("evicted", counters.frames.session_evicted_count);
  add("large_evicted", counters.frames.large_evicted_count);
  add("connections_refused", counters.connection_refused_count);
  add("bad_requests", counters.bad_request_count);
  add("servant_failures", counters.servant_failure_count);
  add("send_failures", counters.send_failure_count);
  add("broken_memory", counters.broken_memory_count);
  return text.empty() ? text : "  " + printable(lane.name) + ":" + text + "\n";
}

constexpr std::size_t kTextColumnCount = 5;

std::string picture_of_lanes(History& history) {
  std::vector<Row> rows{kHead};
  std::string remarks;
  for (const rpc::LaneTable& table : rpc::LaneTable::find()) {
    if (!table.is_known()) {
      remarks += "  process " + std::to_string(table.process_id()) + " has a table of version " +
                 std::to_string(table.version()) + ", which this rtpm can't read\n";
      continue;
    }
    for (const rpc::LaneReading& lane : table.read()) {
      rows.push_back(row_of(table, lane, history));
      remarks += remarks_of(lane);
    }
  }
  if (rows.size() == 1 && remarks.empty()) {
    return "no servers that you may look at run on this host\n";
  }
  return aligned(rows, kTextColumnCount) + remarks;
}

Json json_of(const rpc::LaneTable& table, const rpc::LaneReading& lane) {
  const rpc::LaneSample sample = lane.sample.value_or(rpc::LaneSample{});
  const rpc::ServerCounters& counters = sample.counters;
  Json dropped = Json::object();
  for (std::size_t i = 0; i < wire::kDropReasonCount; ++i) {
    if (const std::uint64_t count = counters.frames.dropped[i]; count > 0) {
      dropped[std::string(to_string(static_cast<wire::DropReason>(i)))] = count;
    }
  }
  return {{"process", table.process_id()},
          {"server", table.server_name()},
          {"host", table.host()},
          {"port", table.port()},
          {"lane", lane.name},
          {"band", {lane.band_low, lane.band_high}},
          {"wait", lane.wait},
          {"schedule", lane.schedule},
          {"call_count", counters.call_count},
          {"longest_cycle_ns", sample.longest_cycle_ns},
          {"queued_count", sample.queued_count},
          {"open_call_count", sample.open_call_count},
          {"dropped", std::move(dropped)},
          {"late_count", counters.late_count},
          {"overload_count", counters.overload_count},
          {"pause_count", sample.pause_count},
          {"busy_count", lane.busy_count}};
}

/// All lanes as one document.
Json json_of_lanes() {
  Json lanes = Json::array();
  for (const rpc::LaneTable& table : rpc::LaneTable::find()) {
    if (!table.is_known()) continue;
    for (const rpc::LaneReading& lane : table.read())
      lanes.push_back(json_of(table, lane));
  }
  return lanes;
}

int lanes(Context& context, bool is_watch) {
  History history;
  do {
    if (context.json) {
      print_json(json_of_lanes());
      continue;
    }
    const std::string picture = picture_of_lanes(history);
    // Clears the screen and draws from the top.
    std::printf("%s%s", is_watch && is_terminal() ? "\x1b[H\x1b[2J" : "", picture.c_str());
    std::fflush(stdout);
  } while (is_watch && !context.stop().wait_for(kWatchInterval));
  return kDone;
}

}  // namespace

void add_lanes(CLI::App& program, Context& context) {
  const auto is_watch = std::make_shared<bool>(false);
  CLI::App& command =
      add_command(program, context, "lanes", "Show what the lanes of this host's servers do",
                  "  rtpm lanes --watch\n", [is_watch](Context& c) { return lanes(c, *is_watch); });
  command.add_flag("--watch", *is_watch, "Again each second, until Ctrl-C");
}

}  // namespace rtpm::tool
