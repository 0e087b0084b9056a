#include "runs/event_run.hpp"

#include <algorithm>

#include "rtpm/rt/clock.hpp"

namespace rtpm::bench {
namespace {

using namespace std::chrono_literals;

/// How long the last of a block may take to arrive.
constexpr Duration kBlockPatience = 500ms;

void take(const EventBoard& board, std::size_t count, std::size_t consumers,
          EventFinding& finding) {
  for (std::size_t event = 0; event < count; ++event) {
    Duration last{0};
    for (std::size_t consumer = 0; consumer < consumers; ++consumer) {
      const Duration latency = board.at(consumer, event);
      if (latency > Duration{0}) {
        finding.each.add(latency);
        finding.all.push_back(latency);
        last = std::max(last, latency);
      } else {
        ++finding.missing_count;
      }
    }
    finding.last.add(last);
  }
}

}  // namespace

expected<void, std::string> measure_events(Duration period, std::size_t count, EventSide& side,
                                           EventBoard& board, std::uint32_t block,
                                           int consumer_count, EventFinding& finding) {
  const auto consumers = static_cast<std::size_t>(consumer_count);
  const std::size_t event_count = std::min(count, board.event_count());
  board.begin(block);
  MonotonicTime due = rt::now() + period;
  for (std::uint32_t i = 0; i < event_count; ++i, due += period) {
    rt::sleep_until(due);
    const EventStamp stamp{.due_ns = to_ns(rt::now()), .block = block, .number = i};
    if (auto pushed = side.push(stamp); !pushed) return pushed;
  }
  const MonotonicTime give_up = rt::now() + kBlockPatience;
  while (board.arrived_count() < consumers * event_count && rt::now() < give_up)
    rt::sleep_until(rt::now() + 1ms);
  take(board, event_count, consumers, finding);
  return {};
}

std::string title_of(const EventSetting& setting) {
  return std::string(setting.network == nullptr ? "events, " : "events, two hosts, ") +
         std::string(to_string(setting.carrier)) + ", " +
         std::string(rt::to_string(setting.wait.strategy)) + " wait, " +
         std::to_string(setting.consumer_count) +
         (setting.consumer_count == 1 ? " consumer" : " consumers") +
         (setting.has_own_hub ? ", hub in the supplier's program" : "") +
         (setting.is_multicast ? ", by multicast" : "");
}

void add_fan_out(Result& result, const Settings& settings, const EventSetting& setting,
                 const Deliveries& rtpm, const Deliveries& floor) {
  JsonObject& json = result.json;
  json.add("case", "events");
  json.add("transport", to_string(setting.carrier));
  if (setting.has_own_hub) json.add("hub", kOwnHub);
  if (setting.is_multicast) json.add("delivery", kMulticast);
  json.add("wait", rt::to_string(setting.wait.strategy));
  json.add("payload", static_cast<std::int64_t>(sizeof(EventStamp)));
  json.add("n", static_cast<std::int64_t>(rtpm.last.count()));
  json.add("rate_hz", settings.rate_hz);
  json.add("consumers", setting.consumer_count);
  json.add("own_threads", setting.has_own_threads);
  add_distribution(json, "each_", rtpm.each);
  add_distribution(json, "last_", rtpm.last);
  add_distribution(json, "floor_each_", floor.each);
  add_distribution(json, "floor_last_", floor.last);
  add_ratios(json, "ratio_each_", rtpm.each, floor.each);
  add_ratios(json, "ratio_last_", rtpm.last, floor.last);
  json.add("missing", static_cast<std::int64_t>(rtpm.missing_count));
  json.add("floor_missing", static_cast<std::int64_t>(floor.missing_count));
  result.rows = {{"RTPM, each", rtpm.each.percentiles()},
                 {"RTPM, last", rtpm.last.percentiles()},
                 {"raw floor, each", floor.each.percentiles()},
                 {"raw floor, last", floor.last.percentiles()}};
  add_rounds(result, rtpm.last, floor.last);
}

}  // namespace rtpm::bench
