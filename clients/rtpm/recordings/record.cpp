#include <algorithm>
#include <cstdio>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "cli/command.hpp"
#include "cli/output.hpp"
#include "cli/progress.hpp"
#include "events/subscription.hpp"
#include "host/latency.hpp"
#include "objects/unbound.hpp"
#include "recordings/commands.hpp"
#include "rtpm/base/printable.hpp"
#include "rtpm/capture/call_recorder.hpp"
#include "rtpm/capture/clock_survey.hpp"
#include "rtpm/capture/device_recorder.hpp"
#include "rtpm/capture/hub_recorder.hpp"
#include "rtpm/capture/medium_recorder.hpp"
#include "rtpm/capture/parameters.hpp"
#include "rtpm/capture/session.hpp"
#include "rtpm/events/filter_text.hpp"
#include "rtpm/events/hub_types.hpp"
#include "rtpm/names/directory.hpp"
#include "rtpm/program/text.hpp"
#include "rtpm/recording/recorder.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/log.hpp"
#include "rtpm/rt/utc.hpp"
#include "rtpm/wire/url.hpp"

namespace rtpm::tool {
namespace {

using program::formatted;

constexpr Duration kReportPeriod = std::chrono::milliseconds{200};

struct RecordRequest : EventRequest {
  std::string file{};
  std::string compression = "zstd";
  bool is_hub_given = false;
  std::vector<std::string> devices{};  ///< Devices to poll, by name.
  double poll_rate_hz = 60;
  std::vector<std::string> media{};  ///< Cameras and microphones, by name or URL.
  std::vector<std::string> calls{};  ///< Objects whose calls are tapped, by name or URL.
  std::vector<std::string> only{};   ///< Devices and types of events; empty for all.
  std::optional<capture::Session> session{};
  std::string pattern{capture::kSessionPattern};  ///< Names a session's file.

  /// Whether events were requested explicitly.
  [[nodiscard]] bool needs_hub() const {
    return is_hub_given || filter != "all" || !only.empty() || session.has_value();
  }
};

/// All sources of a recording.
/// @ownership refers to context, request and recorder
/// @threads  one
class Sources {
 public:
  Sources(Context& context, const RecordRequest& request, recording::Recorder& recorder)
      : context_(context),
        request_(request),
        recorder_(recorder),
        deadline_(context.deadline.value_or(std::chrono::seconds{1})) {}

  /// Opens all requested sources.
  /// @return kDone, or the exit code of the reported error
  int open() {
    if (const int exit_code = open_calls(); exit_code != kDone) return exit_code;
    if (const int exit_code = poll_devices(); exit_code != kDone) return exit_code;
    if (const int exit_code = open_media(); exit_code != kDone) return exit_code;
    // Recording only calls needs no hub, and devices or media are enough if no hub answers.
    if (!request_.needs_hub() && !request_.calls.empty()) return kDone;
    auto types = events::HubTypes::ask(context_.node(), request_.hub, deadline_);
    const bool has_others = !request_.devices.empty() || !request_.media.empty();
    if (!types && !request_.needs_hub() && has_others) return read_parameters(request_.devices);
    if (!types) {
      return context_.not_reached(with_similar_names(context_, request_.hub, types.error()));
    }
    return open_hub(std::move(*types));
  }
  /// Writes the offsets of the sources' clocks into the file.
  /// @param when  "begin" or "end"
  void write_clocks(std::string_view when) {
    clocks_.measure();
    static_cast<void>(recorder_.write(capture::clock_metadata(clocks_, recorder_, when)));
  }
  /// Does the sources' periodic work and reports problems. Call it periodically.
  void attend() {
    if (hub_) hub_->attend();
    report();
  }
  /// Writes what is known at the beginning: the session, versions, this host.
  void write_facts() {
    static_cast<void>(recorder_.write(capture::versions_metadata()));
    if (request_.session) {
      static_cast<void>(recorder_.write(capture::session_metadata(*request_.session)));
    }
  }
  /// Why a source ended by itself; nullopt if none did.
  [[nodiscard]] std::optional<SetupError> problem() const {
    for (const auto& server : calls_) {
      if (const auto problem = server->status().problem) return SetupError{*problem};
    }
    return std::nullopt;
  }
  /// Receives the remaining messages, and ends the sources; their counts stay readable.
  void end() {
    if (hub_) hub_->finish();
    if (parameters_) parameters_->stop();
    if (devices_) devices_->stop();
    for (const auto& medium : media_)
      medium->stop();
    for (const auto& server : calls_)
      server->stop();
    report();
  }
  /// The calls of all servers; dropped_count includes lost events and pictures.
  [[nodiscard]] capture::CallRecorderStatus counts() const {
    capture::CallRecorderStatus sum{.dropped_count = hub_ ? hub_->lost_count() : 0};
    for (const auto& server : calls_) {
      const capture::CallRecorderStatus status = server->status();
      sum.call_count += status.call_count;
      sum.dropped_count += status.dropped_count;
      sum.omitted_payload_count += status.omitted_payload_count;
      sum.unreadable_count += status.unreadable_count;
    }
    for (const auto& medium : media_)
      sum.dropped_count += medium->status().lost_count;
    return sum;
  }

 private:
  // A server has a single tap for all its objects.
  int open_calls() {
    std::map<std::string, std::vector<std::string>> urls;
    for (const std::string& target : request_.calls) {
      const auto url = names::url_of(context_.node(), context_.registry, target);
      if (!url) return context_.not_reached(url.error());
      clocks_.add(target, *url);
      const auto parts = wire::parse_url(*url);
      if (!parts) return context_.fail("'" + *url + "' is no URL", kMisused);
      urls[parts->authority()].push_back(*url);
    }
    for (const auto& [server, objects] : urls) {
      auto calls = capture::CallRecorder::open(recorder_, context_.node(), objects, deadline_);
      if (!calls && calls.error().cause) return context_.not_reached(calls.error());
      if (!calls) return context_.fail(calls.error());
      calls_.push_back(std::move(*calls));
    }
    return kDone;
  }
  int poll_devices() {
    if (!request_.devices.empty()) devices_.emplace(context_.node(), recorder_);
    for (const std::string& name : request_.devices) {
      if (const auto polled = devices_->poll(name, request_.poll_rate_hz); !polled) {
        return context_.not_reached(
            named(name, with_similar_names(context_, name, polled.error())));
      }
      add_clock(name);
    }
    return kDone;
  }
  int open_media() {
    for (const std::string& name : request_.media) {
      auto medium = capture::MediumRecorder::start(context_.node(), recorder_, name);
      if (!medium) {
        return context_.not_reached(
            named(name, with_similar_names(context_, name, medium.error())));
      }
      media_.push_back(std::move(*medium));
    }
    return kDone;
  }
  /// Records the parameters of these devices, and of each one of which an event is recorded.
  int read_parameters(std::vector<std::string> devices) {
    auto parameters = capture::ParameterRecorder::start(
        context_.node(), recorder_, {.hub = request_.hub, .devices = std::move(devices)});
    if (!parameters) return context_.fail(parameters.error());
    parameters_ = std::move(*parameters);
    return kDone;
  }
  /// Splits --only into types of events that the hub knows, and devices.
  expected<events::Filter, SetupError> filter_of_only(const events::HubTypes& types,
                                                      std::vector<std::string>& devices) {
    std::vector<std::string> topics;
    for (const std::string& name : request_.only) {
      const bool is_topic =
          name.starts_with("rtpm.") ||
          std::ranges::any_of(types.list(), [&](const auto* type) { return type->name == name; });
      if (is_topic) {
        topics.push_back(name);
        continue;
      }
      const auto url = names::url_of(context_.node(), context_.registry, name);
      if (!url) return unexpected{with_similar_names(context_, name, SetupError{url.error()})};
      devices.push_back(name);
    }
    return capture::selection_of(types, devices, topics);
  }
  int open_hub(events::HubTypes types) {
    auto filter = events::parse_filter(request_.filter, types.list());
    if (!filter) return context_.fail_at("filter", request_.filter, filter.error());
    std::vector<std::string> devices;
    if (!request_.only.empty()) {
      auto chosen = filter_of_only(types, devices);
      if (!chosen) return context_.fail(named("--only", chosen.error()));
      *filter = std::move(*chosen);
    }
    devices.insert(devices.end(), request_.devices.begin(), request_.devices.end());
    if (const int exit_code = read_parameters(std::move(devices)); exit_code != kDone) {
      return exit_code;
    }
    auto hub = capture::HubRecorder::create(context_.node(), recorder_, std::move(types),
                                            {.hub = request_.hub,
                                             .registry = context_.registry,
                                             .deadline = deadline_,
                                             .filter = *filter,
                                             .every_nth = request_.every_nth,
                                             .priority = context_.priority.value_or(Priority{}),
                                             .parameters = parameters_.get()});
    if (!hub) return context_.fail(hub.error());
    hub_ = std::move(*hub);
    add_clock(request_.hub);
    static_cast<void>(clocks_.add_devices(context_.registry));  // The hub recorder reports it.
    report();
    return kDone;
  }
  void add_clock(const std::string& name) {
    if (const auto url = names::url_of(context_.node(), context_.registry, name)) {
      clocks_.add(name, *url);
    }
  }
  void report() {
    const auto reports = hub_ ? hub_->take_reports() : std::vector<std::string>{};
    for (const std::string& text : reports)
      rt::print_error("rtpm", text);
    const auto missing = parameters_ ? parameters_->take_reports() : std::vector<std::string>{};
    for (const std::string& text : missing)
      rt::print_error("rtpm", text);
    for (const auto& medium : media_) {
      for (const std::string& text : medium->take_reports())
        rt::print_error("rtpm", text);
    }
    if (!devices_) return;
    for (const auto& [name, count] : devices_->failed_counts()) {
      if (!failed_.insert(name).second) continue;
      rt::print_error("rtpm", printable(name) + ": a poll failed; the next ones may find it again");
    }
  }

  Context& context_;
  const RecordRequest& request_;
  recording::Recorder& recorder_;
  Duration deadline_;
  std::vector<std::unique_ptr<capture::CallRecorder>> calls_{};
  std::optional<capture::DeviceRecorder> devices_{};
  std::vector<std::unique_ptr<capture::MediumRecorder>> media_{};
  std::unique_ptr<capture::ParameterRecorder> parameters_{};  ///< Outlives `hub_`.
  std::unique_ptr<capture::HubRecorder> hub_{};
  std::set<std::string> failed_{};  ///< Devices for which a failed poll was reported.
  capture::ClockSurvey clocks_{context_.node()};
};

recording::RecorderConfig config_of(const RecordRequest& request) {
  recording::RecorderConfig config;
  config.writer.profile = "rtpm";
  if (!request.media.empty()) {
    config.message_byte_max = capture::kPictureByteMax;
    config.ring_byte_count = 4 * capture::kPictureByteMax;
  }
  config.writer.compression = request.compression == "zstd"  ? recording::Compression::kZstd
                              : request.compression == "lz4" ? recording::Compression::kLz4
                                                             : recording::Compression::kNone;
  return config;
}

/// "12.0 s, 3456 messages, 1700 calls, 1.2 MB, 0 dropped".
std::string text_of(const RecordRequest& request, Duration time,
                    const recording::RecorderStatus& status,
                    const capture::CallRecorderStatus& counts) {
  std::string text = formatted("%.1f s, %llu messages", std::chrono::duration<double>(time).count(),
                               static_cast<unsigned long long>(status.message_count));
  if (!request.calls.empty()) {
    text += formatted(", %llu calls", static_cast<unsigned long long>(counts.call_count));
  }
  text += formatted(", %.1f MB, %llu dropped", 1e-6 * static_cast<double>(status.byte_count),
                    static_cast<unsigned long long>(status.drop_count + counts.dropped_count));
  const std::uint64_t without = counts.omitted_payload_count + counts.unreadable_count;
  if (without > 0) {
    text += formatted(", %llu payloads left out", static_cast<unsigned long long>(without));
  }
  return text;
}

void tell_end(const Context& context, const RecordRequest& request, Duration time,
              const recording::RecorderStatus& status, const capture::CallRecorderStatus& counts) {
  if (!context.json) {
    print_line(printable(request.file) + ": " + text_of(request, time, status, counts));
    return;
  }
  Json json{{"file", request.file},
            {"time_s", std::chrono::duration<double>(time).count()},
            {"message_count", status.message_count},
            {"byte_count", status.byte_count},
            {"drop_count", status.drop_count},
            {"lost_before_count", counts.dropped_count}};
  if (!request.calls.empty()) {
    json["call_count"] = counts.call_count;
    json["omitted_payload_count"] = counts.omitted_payload_count;
    json["unreadable_payload_count"] = counts.unreadable_count;
  }
  print_json(json);
}

/// Waits for Ctrl-C, the end of the time, a write error, or the end of a source.
/// @return the exit code
int wait_for_end(Context& context, const RecordRequest& request, recording::Recorder& recorder,
                 Sources& sources, MonotonicTime begin) {
  const MonotonicTime end = request.time ? begin + *request.time : kNever;
  StatusLine line(context);
  while (rt::now() < end && !context.stop().wait_for(std::min(kReportPeriod, end - rt::now()))) {
    sources.attend();
    const recording::RecorderStatus status = recorder.status();
    line.show(text_of(request, rt::now() - begin, status, sources.counts()));
    if (status.problem) return kDone;
    if (const auto problem = sources.problem()) return context.fail(*problem);
  }
  return kDone;
}

/// Names the file of a session by its pattern; no file has that name.
expected<std::string, SetupError> file_of_session(const RecordRequest& request) {
  if (auto checked = capture::check(*request.session); !checked) return unexpected{checked.error()};
  auto file = capture::session_file(request.pattern, *request.session, rt::utc_ns(rt::now()));
  if (!file) return file;
  return capture::free_path(*file);
}

int record(Context& context, RecordRequest& request) {
  static_cast<void>(context.stop());
  if (request.session) {
    auto file = file_of_session(request);
    if (!file) return context.fail(file.error().text(), kMisused);
    request.file = std::move(*file);
  }
  if (request.file.empty()) request.file = recording::name_by_time();
  auto recorder = recording::Recorder::create(request.file, config_of(request));
  if (!recorder) return context.fail(recorder.error());
  Sources sources(context, request, **recorder);
  if (const int exit_code = sources.open(); exit_code != kDone) {
    sources.end();
    recorder->reset();
    static_cast<void>(std::remove(request.file.c_str()));  // The file is empty.
    return exit_code;
  }
  const MonotonicTime begin = rt::now();
  sources.write_facts();
  if (request.session && !context.json) {
    print_line("recording " + printable(request.file) + " until Ctrl-C");
  }
  sources.write_clocks("begin");
  if (const recording::Metadata latency = kept_latency(); !latency.values.empty()) {
    static_cast<void>((*recorder)->write(latency));
  }
  const int exit_code = wait_for_end(context, request, **recorder, sources, begin);
  sources.write_clocks("end");
  sources.end();
  const auto closed = (*recorder)->close();
  if (!closed) return context.fail(closed.error());
  tell_end(context, request, rt::now() - begin, (*recorder)->status(), sources.counts());
  return exit_code;
}

void add_source_options(CLI::App& command, const std::shared_ptr<RecordRequest>& request) {
  add_event_options(command, *request);
  command.get_option("--hub")->each(
      [request](const std::string&) { request->is_hub_given = true; });
  command
      .add_option("--devices", request->devices,
                  "Devices that publish no events, to be polled, by name: lab/arm0,lab/knob0")
      ->delimiter(',')
      ->type_name("NAMES");
  command.add_option("--poll-rate", request->poll_rate_hz, "How often, in Hz")
      ->check(CLI::Range(0.1, 10'000.0))
      ->capture_default_str();
  command
      .add_option("--media", request->media,
                  "Cameras and microphones, by name or URL: lab/cam0,lab/mic0")
      ->delimiter(',')
      ->type_name("NAMES");
  command
      .add_option("--calls", request->calls,
                  "Calls of this object, by name or URL; may be repeated")
      ->type_name("TARGET")
      ->allow_extra_args(false);
  command
      .add_option("--only", request->only,
                  "Only these devices and types of events, and trials: lab/arm0,lab.Touched")
      ->delimiter(',')
      ->type_name("NAMES")
      ->excludes("--filter");
  command.add_option("--compression", request->compression, "Of chunks")
      ->check(CLI::IsMember({"zstd", "lz4", "none"}))
      ->capture_default_str();
}

void add_session_options(CLI::App& command, RecordRequest& request) {
  capture::Session& session = *request.session;
  command.add_option("--participant", session.participant, "The participant's code, no name: P07");
  command.add_option("--experiment", session.experiment, "The experiment");
  command.add_option("--condition", session.condition, "The condition");
  command.add_option("--notes", session.notes, "Notes for the reader of the recording");
  for (const char* const name : {"--participant", "--experiment", "--condition", "--notes"})
    command.get_option(name)->type_name("TEXT");
  command
      .add_option("--pattern", request.pattern,
                  "The file's name; a number is added to a name that is taken")
      ->type_name("PATTERN")
      ->capture_default_str();
}

}  // namespace

void add_record(CLI::App& program, Context& context) {
  const auto request = std::make_shared<RecordRequest>();
  CLI::App& command = add_command(
      program, context, "record", "Record the events of a hub, devices, and calls of objects",
      "  rtpm record run.mcap --filter 'type(lab.Touched) or type(rtpm.device.Sampled)'\n"
      "  rtpm record run.mcap --devices lab/knob0 --poll-rate 200\n"
      "  rtpm record run.mcap --calls lab/arm0 --calls lab/arm1\n"
      "  rtpm record run.mcap --media lab/cam0\n"
      "Foxglove and Lichtblick open the file: MCAP with embedded FlatBuffers schemas, a channel "
      "per\n"
      "type and source, of a device by its name: lab/arm0/sampled, lab/arm0/description. `rtpm\n"
      "play` re-creates these devices. --calls records requests, responses and how calls went:\n"
      "lab/arm0/read/request, lab/arm0/read/response, lab/arm0/calls; events come along only with\n"
      "--hub or --filter. --media records cameras and microphones at the time of capture, as\n"
      "lab/cam0/video and lab/cam0/sound. Ctrl-C ends it; one that was killed is saved by `rtpm "
      "bag recover`. "
      "What\n"
      "was dropped is counted, shown, and written into the file, as are the offsets of all "
      "clocks.\n",
      [request](Context& c) { return record(c, *request); });
  command.add_option("FILE", request->file, "The new file; without: rtpm-DATE-TIME.mcap")
      ->type_name("");
  add_source_options(command, request);
}

void add_session(CLI::App& program, Context& context) {
  const auto request = std::make_shared<RecordRequest>();
  request->session.emplace();
  CLI::App& command = add_command(
      program, context, "session", "Record a session of an experiment",
      "  rtpm session --participant P07 --experiment touch --condition soft\n"
      "  rtpm session --participant P07 --pattern 'data/{participant}_{date}_{time}'\n"
      "Records like `rtpm record`, until Ctrl-C, into a new file that has the session, the\n"
      "versions of RTPM and this host, the clocks, and all parameters and calibrations of the\n"
      "devices with each change. The pattern's fields are {participant}, {experiment},\n"
      "{condition}, {date} and {time} in UTC. `rtpm bag info` shows the session, `rtpm mark` "
      "marks\n"
      "moments and trials, and `rtpm play --parameters` sets the parameters again.\n",
      [request](Context& c) { return record(c, *request); });
  add_session_options(command, *request);
  add_source_options(command, request);
}

}  // namespace rtpm::tool
