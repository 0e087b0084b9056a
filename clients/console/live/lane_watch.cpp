#include "live/lane_watch.hpp"

#include <utility>

#include "rtpm/base/printable.hpp"
#include "rtpm/rpc/lane_table.hpp"
#include "rtpm/rt/clock.hpp"

namespace rtpm::console {
namespace {

double per_second(std::uint64_t before, std::uint64_t now, Duration time) {
  const double seconds = std::chrono::duration<double>(time).count();
  return now < before || seconds <= 0 ? 0 : static_cast<double>(now - before) / seconds;
}

std::uint64_t dropped_count(const rpc::LaneSample& sample) {
  std::uint64_t sum = 0;
  for (const std::uint64_t count : sample.counters.frames.dropped)
    sum += count;
  return sum;
}

}  // namespace

std::vector<ServerView> LaneWatch::look() {
  std::vector<ServerView> servers;
  std::map<std::string, Before> seen;
  for (const rpc::LaneTable& table : rpc::LaneTable::find()) {
    if (!table.is_known()) continue;
    ServerView server{.name = printable(table.server_name()),
                      .host = printable(table.host()),
                      .port = table.port(),
                      .process_id = table.process_id(),
                      .is_alive = table.is_alive()};
    for (const rpc::LaneReading& reading : table.read()) {
      const rpc::LaneSample sample = reading.sample.value_or(rpc::LaneSample{});
      LaneView lane{.name = printable(reading.name),
                    .band_low = reading.band_low,
                    .band_high = reading.band_high,
                    .schedule = reading.schedule,
                    .wait = reading.wait,
                    .longest_cycle_us = static_cast<double>(sample.longest_cycle_ns) / 1000,
                    .queued_count = sample.queued_count,
                    .busy_count = reading.busy_count};
      const std::string key =
          std::to_string(server.process_id) + ":" + std::to_string(server.port) + "/" + lane.name;
      const Before now{rt::now(), sample.counters.call_count, dropped_count(sample)};
      if (const auto known = before_.find(key); known != before_.end()) {
        const Before& before = known->second;
        lane.calls_per_s = per_second(before.call_count, now.call_count, now.when - before.when);
        lane.drops_per_s = per_second(before.drop_count, now.drop_count, now.when - before.when);
      }
      seen[key] = now;
      server.lanes.push_back(std::move(lane));
    }
    servers.push_back(std::move(server));
  }
  before_ = std::move(seen);
  return servers;
}

}  // namespace rtpm::console
