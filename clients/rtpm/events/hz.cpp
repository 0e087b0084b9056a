#include <map>
#include <mutex>
#include <string>
#include <utility>

#include "cli/command.hpp"
#include "cli/output.hpp"
#include "cli/table.hpp"
#include "events/commands.hpp"
#include "events/source_names.hpp"
#include "events/stream_meter.hpp"
#include "events/subscription.hpp"
#include "rtpm/base/printable.hpp"
#include "rtpm/capture/event_schemas.hpp"
#include "rtpm/program/text.hpp"
#include "rtpm/rt/clock.hpp"

namespace rtpm::tool {
namespace {

using program::formatted;

constexpr Duration kReportPeriod = std::chrono::seconds{1};

double microseconds(Duration duration) {
  return std::chrono::duration<double, std::micro>(duration).count();
}

/// The events with one source and type.
struct Stream {
  std::string type{};
  StreamMeter meter{};
  std::uint32_t uncertainty_ns = 0;  ///< The largest uncertainty of its origins.
};
using Streams = std::map<std::pair<events::EventType, events::SourceId>, Stream>;

class Meters final : public Subscription::Observer {
 public:
  void on_event(const events::EventView& event, const events::EventDescriptor* type) override {
    const events::EventHeader& header = event.header;
    // Ignores timeouts and replayed events.
    if (header.sequence == 0 || header.is_replayed) return;
    const std::lock_guard lock(mutex_);
    Stream& stream = streams_[{header.type, header.source}];
    stream.type = capture::type_text(header.type, type);
    stream.uncertainty_ns = std::max(stream.uncertainty_ns, header.origin_uncertainty_ns);
    stream.meter.add(header.sequence, header.origin, header.hub_sent - header.origin);
  }
  [[nodiscard]] Streams streams() {
    const std::lock_guard lock(mutex_);
    return streams_;
  }

 private:
  std::mutex mutex_{};
  Streams streams_{};
};

Json json_of(const Streams& streams, SourceNames& sources, std::uint64_t lost_here) {
  Json list = Json::array();
  for (const auto& [key, stream] : streams) {
    const StreamMeter& meter = stream.meter;
    Json json{{"type", stream.type},
              {"source", key.second},
              {"count", meter.count()},
              {"rate_hz", meter.rate_hz()},
              {"lost_count", meter.lost_count()},
              {"duplicate_count", meter.duplicate_count()},
              {"late_count", meter.late_count()},
              {"restart_count", meter.restart_count()},
              {"clock_jump_count", meter.clock_jump_count()}};
    if (const std::string name = sources.name_of(key.second); !name.empty())
      json["source_name"] = name;
    if (const auto jitter = meter.jitter()) {
      json["jitter"] = {{"mean_us", microseconds(jitter->mean)},
                        {"rms_us", jitter->rms_ns * 1e-3},
                        {"max_us", microseconds(jitter->max)}};
    }
    json["latency_us"] = {{"p50", microseconds(meter.latency().percentile(50))},
                          {"p99", microseconds(meter.latency().percentile(99))},
                          {"max", microseconds(meter.latency().max())}};
    if (stream.uncertainty_ns != events::kUncertaintyUnknown) {
      json["uncertainty_us"] = stream.uncertainty_ns * 1e-3;
    }
    list.push_back(std::move(json));
  }
  return {{"streams", std::move(list)}, {"lost_by_this_reader", lost_here}};
}

std::string text_of(const Streams& streams, SourceNames& sources, std::uint64_t lost_here) {
  std::vector<Row> rows{{"TYPE", "SOURCE", "EVENTS", "HZ", "JITTER RMS", "MAX", "LOST",
                         "LATENCY P50", "P99", "MAX", "± CLOCK"}};
  std::string remarks;
  for (const auto& [key, stream] : streams) {
    const StreamMeter& meter = stream.meter;
    const auto jitter = meter.jitter();
    const std::string name = sources.name_of(key.second);
    const std::string source = name.empty() ? std::to_string(key.second) : printable(name);
    const auto us = [](Duration time) { return formatted("%.1f us", microseconds(time)); };
    rows.push_back({printable(stream.type), source, std::to_string(meter.count()),
                    formatted("%.2f", meter.rate_hz()),
                    jitter ? formatted("%.1f us", jitter->rms_ns * 1e-3) : "-",
                    jitter ? us(jitter->max) : "-", std::to_string(meter.lost_count()),
                    us(meter.latency().percentile(50)), us(meter.latency().percentile(99)),
                    us(meter.latency().max()),
                    stream.uncertainty_ns == events::kUncertaintyUnknown
                        ? "unknown"
                        : formatted("%.1f us", stream.uncertainty_ns * 1e-3)});
    const auto add = [&](const char* what, std::uint64_t count) {
      if (count > 0) {
        remarks += "  " + printable(stream.type) + " of " + source + ": " + std::to_string(count) +
                   what + "\n";
      }
    };
    add(" duplicates", meter.duplicate_count());
    add(" out of order", meter.late_count());
    add(" restarts of the source", meter.restart_count());
    add(" jumps of its clock", meter.clock_jump_count());
  }
  if (lost_here > 0) remarks += "  " + std::to_string(lost_here) + " lost by this reader\n";
  return rows.size() == 1 ? "no events came\n" : aligned(rows, 1) + remarks;
}

int hz(Context& context, const EventRequest& request) {
  const program::StopSignal& stop = context.stop();
  Meters meters;
  SourceNames sources(context);
  int exit_code = kDone;
  const auto subscription = Subscription::open(context, request, meters, exit_code);
  if (!subscription) return exit_code;
  const MonotonicTime end = request.time ? rt::now() + *request.time : kNever;
  const bool is_live = is_terminal() && !context.json;
  while (rt::now() < end && !stop.wait_for(std::min(kReportPeriod, end - rt::now()))) {
    subscription->care();
    sources.care();
    if (!is_live) continue;
    std::printf("\x1b[H\x1b[2J");
    print_line(text_of(meters.streams(), sources, subscription->lost_count()));
  }
  const Streams streams = meters.streams();
  for (const auto& [key, stream] : streams)
    static_cast<void>(sources.name_of(key.second));
  sources.care();  // Finds the names of devices that appeared later.
  if (context.json) {
    print_json(json_of(streams, sources, subscription->lost_count()));
  } else if (!is_live) {
    std::fputs(text_of(streams, sources, subscription->lost_count()).c_str(), stdout);
  }
  return streams.empty() ? kFailed : kDone;
}

}  // namespace

void add_hz(CLI::App& program, Context& context) {
  const auto request = std::make_shared<EventRequest>();
  CLI::App& command = add_command(
      program, context, "hz", "Measure rate, jitter, loss and latency of events",
      "  rtpm hz --filter 'type(lab.Touched)' --for 10s\n"
      "Told per type and source, from the events' own numbers and origin times: so this reader's\n"
      "delays do not count. Latency is from the origin to the hub's sending, within the\n"
      "uncertainty of the source's clock. With --every, what is left out counts as lost.\n",
      [request](Context& c) { return hz(c, *request); });
  add_event_options(command, *request);
}

}  // namespace rtpm::tool
