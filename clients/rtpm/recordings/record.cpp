#include <algorithm>
#include <cstdio>
#include <ctime>
#include <memory>
#include <string>

#include "cli/command.hpp"
#include "cli/output.hpp"
#include "cli/progress.hpp"
#include "recordings/commands.hpp"
#include "recordings/sources.hpp"
#include "rtpm/base/printable.hpp"
#include "rtpm/options/formatted.hpp"
#include "rtpm/recording/recorder.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/log.hpp"

namespace rtpm::tool {
namespace {

using options::formatted;

constexpr Duration kReportPeriod = std::chrono::milliseconds{200};

struct RecordRequest : SourceRequest {
  std::string file{};
  std::string compression = "zstd";
};

/// "rtpm-20261124-091500.mcap", in UTC.
std::string name_by_time() {
  const std::time_t now = std::time(nullptr);
  std::tm utc{};
  ::gmtime_r(&now, &utc);
  return formatted("rtpm-%04d%02d%02d-%02d%02d%02d.mcap", utc.tm_year + 1900, utc.tm_mon + 1,
                   utc.tm_mday, utc.tm_hour, utc.tm_min, utc.tm_sec);
}

recording::RecorderConfig config_of(const RecordRequest& request) {
  recording::RecorderConfig config;
  config.writer.profile = "rtpm";
  config.writer.compression = request.compression == "zstd"  ? recording::Compression::kZstd
                              : request.compression == "lz4" ? recording::Compression::kLz4
                                                             : recording::Compression::kNone;
  return config;
}

/// "12.0 s, 3456 messages, 1700 calls, 1.2 MB, 0 dropped".
std::string text_of(const RecordRequest& request, Duration time,
                    const recording::RecorderStatus& status, const SourceCounts& counts) {
  std::string text = formatted("%.1f s, %llu messages", std::chrono::duration<double>(time).count(),
                               static_cast<unsigned long long>(status.message_count));
  if (!request.calls.empty()) {
    text += formatted(", %llu calls", static_cast<unsigned long long>(counts.calls));
  }
  text += formatted(", %.1f MB, %llu dropped", 1e-6 * static_cast<double>(status.byte_count),
                    static_cast<unsigned long long>(status.drop_count + counts.lost));
  const std::uint64_t without = counts.omitted_payloads + counts.unreadable_payloads;
  if (without > 0) {
    text += formatted(", %llu payloads left out", static_cast<unsigned long long>(without));
  }
  return text;
}

void tell_end(const Context& context, const RecordRequest& request, Duration time,
              const recording::RecorderStatus& status, const SourceCounts& counts) {
  if (!context.json) {
    print_line(printable(request.file) + ": " + text_of(request, time, status, counts));
    return;
  }
  Json json{{"file", request.file},
            {"time_s", std::chrono::duration<double>(time).count()},
            {"message_count", status.message_count},
            {"byte_count", status.byte_count},
            {"drop_count", status.drop_count},
            {"lost_before_count", counts.lost}};
  if (!request.calls.empty()) {
    json["call_count"] = counts.calls;
    json["omitted_payload_count"] = counts.omitted_payloads;
    json["unreadable_payload_count"] = counts.unreadable_payloads;
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
    sources.care();
    const recording::RecorderStatus status = recorder.status();
    line.show(text_of(request, rt::now() - begin, status, sources.counts()));
    if (status.problem) return kDone;
    if (const auto problem = sources.problem()) return context.fail(*problem);
  }
  return kDone;
}

int record(Context& context, RecordRequest& request) {
  static_cast<void>(context.stop());
  if (request.file.empty()) request.file = name_by_time();
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
  const int exit_code = wait_for_end(context, request, **recorder, sources, begin);
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
      .add_option("--calls", request->calls,
                  "Calls of this object, by name or URL; may be repeated")
      ->type_name("TARGET")
      ->allow_extra_args(false);
}

}  // namespace

void add_record(CLI::App& program, Context& context) {
  const auto request = std::make_shared<RecordRequest>();
  CLI::App& command = add_command(
      program, context, "record", "Record the events of a hub, devices, and calls of objects",
      "  rtpm record run.mcap --filter 'type(lab.Touched) or type(rtpm.device.Sampled)'\n"
      "  rtpm record run.mcap --devices lab/knob0 --poll-rate 200\n"
      "  rtpm record run.mcap --calls lab/arm0 --calls lab/arm1\n"
      "Foxglove and others open the file: MCAP with embedded FlatBuffers schemas, a channel per\n"
      "type and source, of a device by its name: lab/arm0/sampled, lab/arm0/description. `rtpm\n"
      "play` re-creates these devices. --calls records requests, responses and how calls went:\n"
      "lab/arm0/read/request, lab/arm0/read/response, lab/arm0/calls; events come along only with\n"
      "--hub or --filter. Ctrl-C ends it; one that was killed is saved by `rtpm bag recover`. "
      "What\n"
      "was dropped is counted, shown, and written into the file.\n",
      [request](Context& c) { return record(c, *request); });
  command.add_option("FILE", request->file, "The new file; without: rtpm-DATE-TIME.mcap")
      ->type_name("");
  add_source_options(command, request);
  command.add_option("--compression", request->compression, "Of chunks")
      ->check(CLI::IsMember({"zstd", "lz4", "none"}))
      ->capture_default_str();
}

}  // namespace rtpm::tool
