#include <algorithm>
#include <cstdio>
#include <ctime>
#include <string>

#include "cli/command.hpp"
#include "cli/output.hpp"
#include "cli/progress.hpp"
#include "events/subscription.hpp"
#include "recordings/commands.hpp"
#include "rtpm/base/printable.hpp"
#include "rtpm/capture/event_recorder.hpp"
#include "rtpm/options/formatted.hpp"
#include "rtpm/recording/recorder.hpp"
#include "rtpm/rt/clock.hpp"

namespace rtpm::tool {
namespace {

using options::formatted;

constexpr Duration kPeriod = std::chrono::milliseconds{200};

struct RecordRequest : EventRequest {
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

/// "12.0 s, 3456 messages, 1.2 MB, 0 dropped".
std::string text_of(Duration time, const recording::RecorderStatus& status, std::uint64_t lost) {
  return formatted("%.1f s, %llu messages, %.1f MB, %llu dropped",
                   std::chrono::duration<double>(time).count(),
                   static_cast<unsigned long long>(status.message_count),
                   1e-6 * static_cast<double>(status.byte_count),
                   static_cast<unsigned long long>(status.drop_count + lost));
}

int tell_end(const Context& context, const std::string& file, Duration time,
             const recording::RecorderStatus& status, std::uint64_t lost_count) {
  if (context.json) {
    print_json({{"file", file},
                {"time_s", std::chrono::duration<double>(time).count()},
                {"message_count", status.message_count},
                {"byte_count", status.byte_count},
                {"drop_count", status.drop_count},
                {"lost_before_count", lost_count}});
  } else {
    print_line(printable(file) + ": " + text_of(time, status, lost_count));
  }
  return kDone;
}

/// Hands what a hub sends to the recorder of events.
class Events final : public Subscription::Observer {
 public:
  explicit Events(recording::Recorder& recorder) : events_(recorder) {}
  void on_event(const events::EventView& event, const events::EventDescriptor* type) override {
    events_.record(event, type);
  }

 private:
  capture::EventRecorder events_;
};

/// Until Ctrl-C, the end of the time, or a file that takes no more.
void wait_for_end(Context& context, const RecordRequest& request, recording::Recorder& recorder,
                  Subscription& subscription, MonotonicTime begin) {
  const MonotonicTime end = request.time ? begin + *request.time : kNever;
  StatusLine line(context);
  while (rt::now() < end && !context.stop().wait_for(std::min(kPeriod, end - rt::now()))) {
    subscription.care();
    const recording::RecorderStatus status = recorder.status();
    line.show(text_of(rt::now() - begin, status, subscription.lost_count()));
    if (status.problem) return;
  }
}

int record(Context& context, const RecordRequest& request) {
  static_cast<void>(context.stop());
  const std::string file = request.file.empty() ? name_by_time() : request.file;
  auto recorder = recording::Recorder::create(file, config_of(request));
  if (!recorder) return context.fail(recorder.error());
  Events events(**recorder);
  int exit_code = kDone;
  auto subscription = Subscription::open(context, request, events, exit_code);
  if (!subscription) {
    recorder->reset();
    static_cast<void>(std::remove(file.c_str()));  // It has nothing.
    return exit_code;
  }
  const MonotonicTime begin = rt::now();
  wait_for_end(context, request, **recorder, *subscription, begin);
  const std::uint64_t lost_count = subscription->lost_count();
  subscription.reset();
  const auto closed = (*recorder)->close();
  if (!closed) return context.fail(closed.error());
  return tell_end(context, file, rt::now() - begin, (*recorder)->status(), lost_count);
}

}  // namespace

void add_record(CLI::App& program, Context& context) {
  const auto request = std::make_shared<RecordRequest>();
  CLI::App& command = add_command(
      program, context, "record", "Record the events of a hub, also the samples of its devices",
      "  rtpm record run.mcap --filter 'type(lab.Touched) or type(rtpm.device.Sampled)'\n"
      "Foxglove and others open the file: MCAP with embedded FlatBuffers schemas, a channel per\n"
      "type and source. Ctrl-C ends it; one that was killed is saved by `rtpm bag recover`. What\n"
      "was dropped is counted, shown, and written into the file.\n",
      [request](Context& c) { return record(c, *request); });
  command.add_option("FILE", request->file, "The new file; without: rtpm-DATE-TIME.mcap")
      ->type_name("");
  add_event_options(command, *request);
  command.add_option("--compression", request->compression, "Of chunks")
      ->check(CLI::IsMember({"zstd", "lz4", "none"}))
      ->capture_default_str();
}

}  // namespace rtpm::tool
