#include <atomic>
#include <string>

#include "cli/command.hpp"
#include "events/commands.hpp"
#include "events/echo_device.hpp"
#include "events/payload_json.hpp"
#include "events/source_names.hpp"
#include "events/subscription.hpp"
#include "rtpm/base/printable.hpp"
#include "rtpm/program/text.hpp"
#include "rtpm/rt/clock.hpp"

namespace rtpm::tool {
namespace {

constexpr Duration kPrintPeriod = std::chrono::milliseconds{50};

struct EchoRequest : EventRequest {
  std::uint64_t count = 0;  ///< 0 for no limit.
  std::string device{};     ///< If empty, the hub's events.
  double rate_hz = 60;
};

Json json_of(const events::EventView& event, const events::EventDescriptor* type,
             const std::string& source_name, Json payload) {
  const events::EventHeader& header = event.header;
  Json json{{"type", capture::type_text(header.type, type)},
            {"type_number", header.type},
            {"source", header.source},
            {"sequence", header.sequence},
            {"origin_ns", to_ns(header.origin)}};
  if (!source_name.empty()) json["source_name"] = source_name;
  if (header.origin_uncertainty_ns != events::kUncertaintyUnknown) {
    json["origin_uncertainty_ns"] = header.origin_uncertainty_ns;
  }
  json["hub_received_ns"] = to_ns(header.hub_received);
  json["hub_sent_ns"] = to_ns(header.hub_sent);
  json["priority"] = header.priority.value();
  if (header.is_replayed) json["is_replayed"] = true;
  json["payload"] = std::move(payload);
  return json;
}

/// "12.345678901  lab.Touched  source 3  #17  {…}", or "lab/arm0" in place of "source 3".
std::string line_of(const events::EventView& event, const events::EventDescriptor* type,
                    const std::string& source_name, const Json& payload) {
  const events::EventHeader& header = event.header;
  return program::formatted("%.6f  ", static_cast<double>(to_ns(header.origin)) * 1e-9) +
         printable(capture::type_text(header.type, type)) + "  " +
         (source_name.empty() ? "source " + std::to_string(header.source)
                              : printable(source_name)) +
         "  #" + std::to_string(header.sequence) + "  " +
         printable(payload.dump(-1, ' ', false, Json::error_handler_t::replace), kShownWhole);
}

class Echo final : public Subscription::Observer {
 public:
  Echo(Context& context, std::uint64_t count)
      : sources_(context), as_json_(context.json), left_count_(count) {}

  void on_event(const events::EventView& event, const events::EventDescriptor* type) override {
    if (is_done_) return;
    Json payload = payload_json(schemas_, event.payload, type);
    const std::string source_name = sources_.name_of(event.header.source);
    if (as_json_) {
      print_json(json_of(event, type, source_name, std::move(payload)));
    } else {
      print_line(line_of(event, type, source_name, payload));
    }
    if (left_count_ > 0 && --left_count_ == 0) is_done_ = true;
  }
  [[nodiscard]] bool is_done() const { return is_done_; }
  void care() { sources_.care(); }

 private:
  SourceNames sources_;
  capture::EventSchemas schemas_{};
  bool as_json_;
  std::uint64_t left_count_;
  std::atomic<bool> is_done_{false};
};

int echo(Context& context, const EchoRequest& request) {
  if (!request.device.empty()) {
    return echo_device(context, {request.device, request.rate_hz, request.count, request.time});
  }
  const program::StopSignal& stop = context.stop();
  Echo echo(context, request.count);
  int exit_code = kDone;
  const auto subscription = Subscription::open(context, request, echo, exit_code);
  if (!subscription) return exit_code;
  const MonotonicTime end = request.time ? rt::now() + *request.time : kNever;
  while (!echo.is_done() && rt::now() < end && !stop.wait_for(kPrintPeriod)) {
    subscription->care();
    echo.care();
  }
  subscription->care();
  return kDone;
}

}  // namespace

void add_echo(CLI::App& program, Context& context) {
  const auto request = std::make_shared<EchoRequest>();
  CLI::App& command = add_command(
      program, context, "echo",
      "Print the events of a hub, or the samples of a device, as they come",
      "  rtpm echo\n"
      "  rtpm echo lab/arm0 --rate 10\n"
      "  rtpm echo --filter 'type(lab.Touched) and source(3) and force.z > 2' --count 10\n"
      "Each line has the origin's time in seconds, type, source (a device's name, else a\n"
      "number), sequence and the payload.\n"
      "Events that came too quickly for this reader are reported as lost. A device is polled,\n"
      "without a hub: each line has its host's time in seconds, name, sequence and the sample.\n",
      [request](Context& c) { return echo(c, *request); });
  add_target(command, request->device, "DEVICE")
      .required(false)
      ->description("Polls this device, by name or URL; without: the hub's events");
  add_event_options(command, *request);
  for (const char* option : {"--hub", "--filter", "--every"})
    command.get_option(option)->excludes("DEVICE");
  command.add_option("--rate", request->rate_hz, "Of a device: polls per second, in Hz")
      ->check(CLI::Range(0.1, 10'000.0))
      ->capture_default_str();
  add_count(command, "--count", request->count, "End after so many; 0: no limit");
}

}  // namespace rtpm::tool
