#include "host/top_picture.hpp"

#include <algorithm>
#include <sstream>

#include "cli/table.hpp"
#include "host/lane_text.hpp"
#include "objects/entries.hpp"
#include "rtpm/base/printable.hpp"
#include "rtpm/names/directory.hpp"
#include "rtpm/program/text.hpp"
#include "rtpm/rt/clock.hpp"

namespace rtpm::tool {
namespace {

using program::formatted;

constexpr std::string_view kDeviceInterface = "rtpm.device.Device";
/// A device that takes longer counts as not read, so that the picture stays current.
constexpr Duration kReadDeadline = std::chrono::milliseconds{100};

double per_second(std::uint64_t before, std::uint64_t now, Duration time) {
  const double seconds = std::chrono::duration<double>(time).count();
  if (now < before || seconds <= 0) return 0;
  return static_cast<double>(now - before) / seconds;
}

std::vector<std::string> lines_of(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream stream(text);
  for (std::string line; std::getline(stream, line);)
    lines.push_back(line);
  return lines;
}

/// A device in an emergency stop stays active, but accepts no commands.
std::string state_text(const driver::Sample& sample) {
  if (sample.faults.has(driver::Fault::kEmergencyStop)) return "EMERGENCY STOP";
  return std::string(to_string(sample.lifecycle));
}

void sort(std::vector<TopLane>& lanes, SortKey key) {
  std::ranges::stable_sort(lanes, [key](const TopLane& a, const TopLane& b) {
    switch (key) {
      case SortKey::kCalls:
        return a.calls_per_s > b.calls_per_s;
      case SortKey::kLongest:
        return a.sample.longest_cycle_ns > b.sample.longest_cycle_ns;
      case SortKey::kDrops:
        return a.drops_per_s > b.drops_per_s;
      case SortKey::kServer:
        break;
    }
    return std::pair(a.server, a.lane) < std::pair(b.server, b.lane);
  });
}

}  // namespace

std::string_view to_string(SortKey key) noexcept {
  switch (key) {
    case SortKey::kCalls:
      return "calls";
    case SortKey::kLongest:
      return "longest";
    case SortKey::kDrops:
      return "drops";
    case SortKey::kServer:
      break;
  }
  return "server";
}

TopState TopObserver::look(SortKey key) {
  TopState state;
  look_at_lanes(state);
  look_at_devices(state);
  sort(state.lanes, key);
  return state;
}

void TopObserver::look_at_lanes(TopState& state) {
  for (const rpc::LaneTable& table : rpc::LaneTable::find()) {
    if (!table.is_known()) continue;
    for (const rpc::LaneReading& reading : table.read()) {
      TopLane lane{.server = server_text(table),
                   .lane = printable(reading.name),
                   .process_id = table.process_id(),
                   .sample = reading.sample.value_or(rpc::LaneSample{})};
      const rpc::ServerCounters& counters = lane.sample.counters;
      const Before now{rt::now(), counters.call_count, dropped_count(counters.frames)};
      Before& before = lanes_[std::to_string(table.process_id()) + lane.server + lane.lane];
      if (before.when != MonotonicTime{}) {
        lane.calls_per_s = per_second(before.count, now.count, now.when - before.when);
        lane.drops_per_s = per_second(before.drop_count, now.drop_count, now.when - before.when);
      }
      before = now;
      state.lanes.push_back(std::move(lane));
    }
  }
}

void TopObserver::look_at_devices(TopState& state) {
  const auto entries = names::Directory(context_.node(), context_.registry).list();
  if (!entries) {
    state.registry_problem = entries.error().reason();
    return;
  }
  for (const names::NameEntry& entry : *entries) {
    if (entry.interface == kDeviceInterface) state.devices.push_back(read(entry.name));
  }
  for (const names::LapsedName& lost : lost_names(context_, *entries)) {
    if (lost.interface != kDeviceInterface) continue;
    state.devices.push_back({.name = printable(lost.name), .problem = lost_text(lost)});
  }
}

TopDevice TopObserver::read(const std::string& name) {
  TopDevice shown{.name = printable(name)};
  auto known = devices_.find(name);
  if (known == devices_.end()) {
    gvd::DeviceClientOptions options;
    options.bind.deadline = kReadDeadline;
    auto client = gvd::DeviceClient::open(context_.node(), name, options);
    if (!client) {
      shown.problem = printable(client.error().reason());
      return shown;
    }
    known = devices_.emplace(name, Device{.client = std::move(*client)}).first;
  }
  Device& device = known->second;
  const MonotonicTime begin = rt::now();
  const auto sample = device.client.read({.deadline = kReadDeadline});
  if (!sample) {
    shown.problem = std::string(to_string(sample.error()));
    return shown;
  }
  const MonotonicTime end = rt::now();
  device.read_time.record(end - begin);
  if (device.before.when != MonotonicTime{}) {
    shown.cycles_per_s =
        per_second(device.before.count, sample->sequence, end - device.before.when);
  }
  device.before = {end, sample->sequence, 0};
  shown.sample = *sample;
  shown.read_time = device.read_time;
  return shown;
}

TopPicture picture_of(const TopState& state) {
  TopPicture picture;
  std::uint64_t connection_count = 0;
  double calls_per_s = 0;
  double drops_per_s = 0;
  std::vector<Row> lanes{{"SERVER", "LANE", "PROCESS", "CALLS/S", "LONGEST", "QUEUE", "OPEN",
                          "CONNECTIONS", "DROPS/S", "DROPPED", "LATE"}};
  for (const TopLane& lane : state.lanes) {
    const rpc::LaneSample& sample = lane.sample;
    connection_count += sample.open_connection_count;
    calls_per_s += lane.calls_per_s;
    drops_per_s += lane.drops_per_s;
    lanes.push_back({lane.server, lane.lane, std::to_string(lane.process_id),
                     formatted("%.0f", lane.calls_per_s), time_text(sample.longest_cycle_ns),
                     std::to_string(sample.queued_count), std::to_string(sample.open_call_count),
                     std::to_string(sample.open_connection_count),
                     formatted("%.0f", lane.drops_per_s),
                     std::to_string(dropped_count(sample.counters.frames)),
                     std::to_string(sample.counters.late_count)});
  }
  std::vector<Row> devices{
      {"DEVICE", "STATE", "CYCLES/S", "GOOD", "READ P50", "P99", "MAX", "FAULTS"}};
  std::string problems;
  for (const TopDevice& device : state.devices) {
    if (!device.problem.empty()) {
      devices.push_back({device.name, device.problem, "-", "-", "-", "-", "-", "-"});
      continue;
    }
    const LatencyHistogram& time = device.read_time;
    devices.push_back(
        {device.name, state_text(device.sample), formatted("%.0f", device.cycles_per_s),
         formatted("%.0f %%", 100.0 * static_cast<double>(device.sample.success_rate)),
         time_text(time.percentile(50).count()), time_text(time.percentile(99).count()),
         time_text(time.max().count()), to_text(device.sample.faults)});
  }
  picture.summary =
      formatted("%zu lanes, %zu devices, %llu connections; %.0f calls/s, %.0f drops/s",
                state.lanes.size(), state.devices.size(),
                static_cast<unsigned long long>(connection_count), calls_per_s, drops_per_s);
  if (!state.registry_problem.empty()) {
    picture.summary += "; " + printable(state.registry_problem);
  }
  picture.lanes = lines_of(aligned(lanes, 2));
  picture.devices = lines_of(aligned(devices, 2));
  return picture;
}

Json json_of(const TopState& state) {
  Json lanes = Json::array();
  for (const TopLane& lane : state.lanes) {
    lanes.push_back({{"server", lane.server},
                     {"lane", lane.lane},
                     {"process", lane.process_id},
                     {"calls_per_s", lane.calls_per_s},
                     {"drops_per_s", lane.drops_per_s},
                     {"call_count", lane.sample.counters.call_count},
                     {"dropped_count", dropped_count(lane.sample.counters.frames)},
                     {"longest_cycle_ns", lane.sample.longest_cycle_ns},
                     {"queued_count", lane.sample.queued_count},
                     {"connection_count", lane.sample.open_connection_count}});
  }
  Json devices = Json::array();
  for (const TopDevice& device : state.devices) {
    Json json{{"name", device.name}};
    if (!device.problem.empty()) {
      json["problem"] = device.problem;
    } else {
      json["lifecycle"] = to_string(device.sample.lifecycle);
      json["is_stopped"] = device.sample.faults.has(driver::Fault::kEmergencyStop);
      json["faults"] = to_text(device.sample.faults);
      json["cycles_per_s"] = device.cycles_per_s;
      json["success_rate"] = device.sample.success_rate;
      json["read_ns"] = {{"p50", device.read_time.percentile(50).count()},
                         {"p99", device.read_time.percentile(99).count()},
                         {"max", device.read_time.max().count()}};
    }
    devices.push_back(std::move(json));
  }
  return {{"lanes", std::move(lanes)}, {"devices", std::move(devices)}};
}

}  // namespace rtpm::tool
