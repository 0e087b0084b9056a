#include "host/latency.hpp"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <iterator>
#include <optional>
#include <vector>

#include "cli/kept_folder.hpp"
#include "cli/output.hpp"
#include "cli/progress.hpp"
#include "cli/table.hpp"
#include "objects/unbound.hpp"
#include "rtpm/base/nesting.hpp"
#include "rtpm/base/printable.hpp"
#include "rtpm/capture/clock_survey.hpp"
#include "rtpm/gvd/client.hpp"
#include "rtpm/names/directory.hpp"
#include "rtpm/program/text.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/utc.hpp"

namespace rtpm::tool {
namespace {

using program::formatted;

constexpr int kStimulusCount = 15;
constexpr Duration kAnswerMax = std::chrono::milliseconds{500};
/// On a loaded host, too.
const rpc::CallOptions kCall{.deadline = std::chrono::milliseconds{100}};
constexpr Duration kReadPeriod = std::chrono::microseconds{200};
/// A command lasts for `kHold`, and is repeated by then.
constexpr Duration kHold = std::chrono::milliseconds{50};
constexpr Duration kRepeat = std::chrono::milliseconds{10};
/// The part of an analog's range by which it must change.
constexpr double kChangeMin = 0.25;

std::string kept_file() {
  const std::string folder = kept_folder();
  return folder.empty() ? "" : folder + "/latency.json";
}

/// An object with a text per "device/output"; empty if the file is absent or damaged.
Json read_kept() {
  std::ifstream file(kept_file());
  const std::string text{std::istreambuf_iterator<char>(file), {}};
  Json kept = parse_bounded_json<Json>(text);
  return kept.is_object() ? kept : Json::object();
}

/// The answers of one sensor to one output.
struct Loop {
  std::string output;
  std::string sensor{};
  std::vector<Duration> to_sample{};  ///< From the command to the sample's own time.
  std::vector<Duration> to_reader{};  ///< From the command to the sample's arrival here.
  int lost_count = 0;
};

struct Answer {
  std::string sensor;
  Duration to_sample;
  Duration to_reader;
};

class LatencyMeter {
 public:
  LatencyMeter(Context& context, gvd::DeviceClient& device, Duration clock_offset)
      : context_(context), device_(device), clock_offset_(clock_offset) {}

  /// @errors the device refuses a command, or does not answer
  [[nodiscard]] expected<Loop, gvd::DeviceError> measure(std::size_t output) {
    Loop loop{.output = device_.descriptor().outputs[output].name};
    for (int i = 0; i < kStimulusCount; ++i) {
      // The pauses differ, so that the stimuli fall on all phases of the device's cycle.
      const Duration pause = std::chrono::milliseconds{100} + i * std::chrono::microseconds{730};
      if (auto rested = rest(output, pause); !rested) return unexpected{rested.error()};
      if (context_.stop().wait_for(Duration{0})) break;
      const auto answer = stimulate(output);
      if (!answer) return unexpected{answer.error()};
      if (!*answer) {
        ++loop.lost_count;
      } else if (loop.sensor.empty() || loop.sensor == (*answer)->sensor) {
        loop.sensor = (*answer)->sensor;
        loop.to_sample.push_back((*answer)->to_sample);
        loop.to_reader.push_back((*answer)->to_reader);
      } else {
        ++loop.lost_count;  // Another sensor was first: no answer to this stimulus alone.
      }
    }
    if (auto rested = rest(output, std::chrono::milliseconds{20}); !rested)
      return unexpected{rested.error()};
    std::ranges::sort(loop.to_sample);
    std::ranges::sort(loop.to_reader);
    return loop;
  }

 private:
  using Answered = expected<std::optional<Answer>, gvd::DeviceError>;

  /// One stimulus, after rest().
  Answered stimulate(std::size_t output) {
    const auto before = device_.read(kCall);
    if (!before) return unexpected{before.error()};
    std::array<float, driver::kOutputCountMax> outputs = safe_outputs();
    outputs[output] = static_cast<float>(device_.descriptor().outputs[output].high);
    const MonotonicTime begin = rt::now();
    MonotonicTime next_command = begin;
    std::optional<Answer> answer;
    while (!answer && rt::now() - begin < kAnswerMax) {
      if (rt::now() >= next_command) {
        if (auto set = device_.set(driver::Setpoint::with_outputs(outputs), kCall); !set) {
          return unexpected{set.error()};
        }
        next_command = rt::now() + kRepeat;
      }
      const auto sample = device_.read(kCall);
      if (!sample) return unexpected{sample.error()};
      const std::string sensor = changed(*before, *sample);
      if (!sensor.empty()) {
        answer = Answer{sensor, sample->host_time - clock_offset_ - begin, rt::now() - begin};
      }
      if (context_.stop().wait_for(kReadPeriod)) break;
    }
    return answer;
  }
  /// Makes the outputs safe, and waits until the device has applied that and its sensors are still
  /// for `pause`.
  gvd::DeviceResult rest(std::size_t output, Duration pause) {
    const MonotonicTime end = rt::now() + kAnswerMax;
    auto last = device_.read(kCall);
    MonotonicTime still_since = rt::now();
    while (rt::now() < end && rt::now() - still_since < pause) {
      if (auto set = device_.set(driver::Setpoint::with_outputs(safe_outputs()), kCall); !set)
        return set;
      if (context_.stop().wait_for(std::chrono::milliseconds{5})) break;
      const auto sample = device_.read(kCall);
      if (!sample) return unexpected{sample.error()};
      const bool is_safe =
          sample->outputs_applied[output] == static_cast<float>(safe_outputs()[output]);
      if (!is_safe || !last || !changed(*last, *sample).empty()) still_since = rt::now();
      last = sample;
    }
    return {};
  }
  [[nodiscard]] std::array<float, driver::kOutputCountMax> safe_outputs() const {
    std::array<float, driver::kOutputCountMax> outputs{};
    const auto& list = device_.descriptor().outputs;
    for (std::size_t i = 0; i < list.size(); ++i)
      outputs[i] = static_cast<float>(list[i].safe);
    return outputs;
  }
  /// The first sensor that differs clearly; empty if none does.
  [[nodiscard]] std::string changed(const driver::Sample& before,
                                    const driver::Sample& after) const {
    const driver::Descriptor& descriptor = device_.descriptor();
    for (std::size_t i = 0; i < descriptor.buttons.size(); ++i) {
      if (before.button_edges[i] != after.button_edges[i]) return descriptor.buttons[i];
    }
    for (std::size_t i = 0; i < descriptor.analogs.size(); ++i) {
      const driver::Analog& analog = descriptor.analogs[i];
      const double change = std::abs(double{after.analogs[i]} - double{before.analogs[i]});
      if (change > kChangeMin * (analog.high - analog.low)) return analog.name;
    }
    return "";
  }

  Context& context_;
  gvd::DeviceClient& device_;
  Duration clock_offset_;  ///< The device's clock minus this host's.
};

double latency_ms(Duration duration) {
  return std::chrono::duration<double, std::milli>(duration).count();
}

std::string span_text(const std::vector<Duration>& sorted) {
  return formatted("%.2f  %.2f  %.2f", latency_ms(sorted.front()),
                   latency_ms(sorted[sorted.size() / 2]), latency_ms(sorted.back()));
}

Json span_json(const std::vector<Duration>& sorted) {
  return {{"min", latency_ms(sorted.front())},
          {"p50", latency_ms(sorted[sorted.size() / 2])},
          {"max", latency_ms(sorted.back())}};
}

/// Replaces the device's figures in the file that recordings are made with.
void keep(const std::string& device, const std::vector<Loop>& loops, Duration error) {
  Json kept = read_kept();
  for (const Loop& loop : loops) {
    if (loop.to_sample.empty()) {
      kept.erase(device + "/" + loop.output);
      continue;
    }
    kept[device + "/" + loop.output] = formatted(
        "%s to the sample: %.3f to %.3f ms, median %.3f ms, error %.3f ms, at UTC %llu ns",
        loop.sensor.c_str(), latency_ms(loop.to_sample.front()), latency_ms(loop.to_sample.back()),
        latency_ms(loop.to_sample[loop.to_sample.size() / 2]), latency_ms(error),
        static_cast<unsigned long long>(rt::utc_ns(rt::now())));
  }
  std::ofstream(kept_file()) << kept.dump(1, ' ', false, Json::error_handler_t::replace) << "\n";
}

void print_loops(const Context& context, const std::string& device, const std::vector<Loop>& loops,
                 Duration uncertainty, Duration period) {
  if (context.json) {
    Json list = Json::array();
    for (const Loop& loop : loops) {
      Json json{{"output", loop.output},
                {"sensor", loop.sensor},
                {"count", loop.to_sample.size()},
                {"lost_count", loop.lost_count}};
      if (!loop.to_sample.empty()) {
        json["to_sample_ms"] = span_json(loop.to_sample);
        json["to_reader_ms"] = span_json(loop.to_reader);
      }
      list.push_back(std::move(json));
    }
    print_json({{"device", device},
                {"period_ms", latency_ms(period)},
                {"clock_uncertainty_ms", latency_ms(uncertainty)},
                {"loops", std::move(list)}});
    return;
  }
  std::vector<Row> rows{{"OUTPUT", "SENSOR", "ANSWERS", "LOST", "TO SAMPLE MS: MIN MED MAX",
                         "TO HERE MS: MIN MED MAX"}};
  for (const Loop& loop : loops) {
    const bool is_empty = loop.to_sample.empty();
    rows.push_back({printable(loop.output), is_empty ? "none" : printable(loop.sensor),
                    std::to_string(loop.to_sample.size()), std::to_string(loop.lost_count),
                    is_empty ? "-" : span_text(loop.to_sample),
                    is_empty ? "-" : span_text(loop.to_reader)});
  }
  print_line(aligned(rows, 2) +
             formatted("Each ± %.3f ms of the clocks and one period of the device, %.3f ms.",
                       latency_ms(uncertainty), latency_ms(period)));
}

}  // namespace

int measure_latency(Context& context, const std::string& device) {
  static_cast<void>(context.stop());
  const auto url = names::url_of(context.node(), context.registry, device);
  if (!url) return context.not_reached(with_similar_names(context, device, url.error()));
  capture::ClockSurvey survey(context.node());
  survey.add(device, *url);
  survey.measure(32);
  const auto& clock = survey.clocks().front().clock;
  if (!clock) return context.fail({device + ": its clock is unknown", survey.clocks()[0].problem});
  auto client = gvd::DeviceClient::open(context.node(), *url, {.hold = kHold});
  if (!client) return context.not_reached(client.error());
  if (client->descriptor().outputs.empty()) {
    return context.fail({device + " has no outputs, so it can make no stimulus", "",
                         "name a device with outputs and sensors, such as a stimulus board"});
  }
  if (auto acquired = client->acquire(); !acquired) {
    return context.fail({device + ": no lease", std::string(gvd::to_string(acquired.error()))});
  }
  std::vector<Loop> loops;
  LatencyMeter meter(context, *client, clock->offset);
  for (std::size_t i = 0; i < client->descriptor().outputs.size(); ++i) {
    StatusLine status(context);
    status.show("measuring " + printable(client->descriptor().outputs[i].name));
    auto loop = meter.measure(i);
    if (!loop) {
      return context.fail({device + ": " + client->descriptor().outputs[i].name + " failed",
                           std::string(gvd::to_string(loop.error()))});
    }
    loops.push_back(std::move(*loop));
  }
  static_cast<void>(client->release());
  const double rate_hz = client->descriptor().rate_hz;
  const auto period = std::chrono::duration_cast<Duration>(
      std::chrono::duration<double>(rate_hz > 0 ? 1 / rate_hz : 0));
  keep(device, loops, clock->uncertainty + period);
  print_loops(context, device, loops, clock->uncertainty, period);
  const bool is_answered =
      std::ranges::any_of(loops, [](const Loop& loop) { return !loop.to_sample.empty(); });
  return is_answered ? kDone : kFailed;
}

recording::Metadata kept_latency() {
  recording::Metadata metadata{.name = "rtpm.latency"};
  const Json kept = read_kept();
  for (const auto& [name, text] : kept.items()) {
    if (text.is_string()) metadata.values[name] = text.get<std::string>();
  }
  return metadata;
}

}  // namespace rtpm::tool
