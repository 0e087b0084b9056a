#include <algorithm>
#include <cstdio>
#include <ctime>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "cli/command.hpp"
#include "cli/output.hpp"
#include "cli/progress.hpp"
#include "devices/device_names.hpp"
#include "events/subscription.hpp"
#include "objects/unbound.hpp"
#include "recordings/commands.hpp"
#include "rtpm/base/printable.hpp"
#include "rtpm/capture/device_recorder.hpp"
#include "rtpm/capture/event_recorder.hpp"
#include "rtpm/events/hub_types.hpp"
#include "rtpm/options/formatted.hpp"
#include "rtpm/recording/recorder.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/log.hpp"

namespace rtpm::tool {
namespace {

using options::formatted;

constexpr Duration kPeriod = std::chrono::milliseconds{200};

struct RecordRequest : EventRequest {
  std::string file{};
  std::string compression = "zstd";
  std::vector<std::string> devices{};
  double poll_rate_hz = 60;
  bool is_hub_given = false;
};

/// What puts messages into the recording, beside others.
class Source {
 public:
  Source() = default;
  Source(const Source&) = delete;
  Source& operator=(const Source&) = delete;
  virtual ~Source() = default;
  /// Attends to it and tells what went wrong. Called now and then.
  virtual void care() {}
  /// Messages that were lost before they came here.
  [[nodiscard]] virtual std::uint64_t lost_count() const { return 0; }
  /// Nothing comes from it any more.
  virtual void end() {}
};
using Sources = std::vector<std::unique_ptr<Source>>;

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

/// The events of a hub, and the descriptions of the devices that push some of them.
class HubSource final : public Source, private Subscription::Observer {
 public:
  HubSource(Context& context, recording::Recorder& recorder, capture::DeviceRecorder& devices)
      : context_(context), devices_(devices), events_(recorder) {}

  /// @return whether it is open; else it was told why
  bool open(const EventRequest& request, int& exit_code) {
    // Before their first events come.
    const auto unnamed = name_devices();
    subscription_ = Subscription::open(context_, request, *this, exit_code);
    if (subscription_ == nullptr) return false;
    if (unnamed) {
      rt::print_error("rtpm", "devices are recorded by number, not by name, and can't be played: " +
                                  unnamed->text());
    }
    return true;
  }
  void care() override {
    subscription_->care();
    if (events_.take_new_unnamed()) static_cast<void>(name_devices());
    for (const std::string& name : events_.take_new_devices()) {
      if (const auto described = devices_.describe(name); !described) {
        rt::print_error("rtpm", named(name, described.error()).text() +
                                    "; without its description it can't be played");
      }
    }
  }
  [[nodiscard]] std::uint64_t lost_count() const override {
    return subscription_ ? subscription_->lost_count() : lost_count_;
  }
  void end() override {
    care();
    lost_count_ = lost_count();
    subscription_.reset();
  }

 private:
  void on_event(const events::EventView& event, const events::EventDescriptor* type) override {
    events_.record(event, type);
  }
  /// @return why the names are not known
  std::optional<SetupError> name_devices() {
    const auto names = device_names(context_);
    if (!names) return names.error();
    events_.name_devices(*names);
    return std::nullopt;
  }

  Context& context_;
  capture::DeviceRecorder& devices_;
  capture::EventRecorder events_;
  std::unique_ptr<Subscription> subscription_{};
  std::uint64_t lost_count_ = 0;
};

/// The samples of polled devices.
class PollSource final : public Source {
 public:
  explicit PollSource(capture::DeviceRecorder& devices) : devices_(devices) {}

  void care() override {
    for (const auto& [name, count] : devices_.failed_counts()) {
      if (std::exchange(told_[name], true)) continue;
      rt::print_error("rtpm", printable(name) + ": a poll failed; the next ones may find it again");
    }
  }
  void end() override { devices_.stop(); }

 private:
  capture::DeviceRecorder& devices_;
  std::map<std::string, bool> told_{};
};

/// Opens what `request` asks for. @return false: it was told why not, with its exit code
bool open(Context& context, const RecordRequest& request, recording::Recorder& recorder,
          capture::DeviceRecorder& devices, Sources& sources, int& exit_code) {
  for (const std::string& name : request.devices) {
    if (const auto polled = devices.poll(name, request.poll_rate_hz); !polled) {
      exit_code =
          context.not_reached(named(name, with_similar_names(context, name, polled.error())));
      return false;
    }
  }
  if (!request.devices.empty()) {
    sources.push_back(std::make_unique<PollSource>(devices));
    // Devices alone are a recording, too, where nobody asked for a hub.
    const bool needs_hub = request.is_hub_given || request.filter != "all";
    if (!needs_hub && !events::HubTypes::ask(context.node(), request.hub)) return true;
  }
  auto hub = std::make_unique<HubSource>(context, recorder, devices);
  if (!hub->open(request, exit_code)) return false;
  sources.push_back(std::move(hub));
  return true;
}

std::uint64_t lost_count_of(const Sources& sources) {
  std::uint64_t count = 0;
  for (const auto& source : sources)
    count += source->lost_count();
  return count;
}

/// Until Ctrl-C, the end of the time, or a file that takes no more.
void wait_for_end(Context& context, const RecordRequest& request, recording::Recorder& recorder,
                  const Sources& sources, MonotonicTime begin) {
  const MonotonicTime end = request.time ? begin + *request.time : kNever;
  StatusLine line(context);
  while (rt::now() < end && !context.stop().wait_for(std::min(kPeriod, end - rt::now()))) {
    for (const auto& source : sources)
      source->care();
    const recording::RecorderStatus status = recorder.status();
    line.show(text_of(rt::now() - begin, status, lost_count_of(sources)));
    if (status.problem) return;
  }
}

int record(Context& context, const RecordRequest& request) {
  static_cast<void>(context.stop());
  const std::string file = request.file.empty() ? name_by_time() : request.file;
  auto recorder = recording::Recorder::create(file, config_of(request));
  if (!recorder) return context.fail(recorder.error());
  capture::DeviceRecorder devices(context.node(), **recorder);
  Sources sources;
  int exit_code = kDone;
  if (!open(context, request, **recorder, devices, sources, exit_code)) {
    sources.clear();
    devices.stop();
    recorder->reset();
    static_cast<void>(std::remove(file.c_str()));  // It has nothing.
    return exit_code;
  }
  const MonotonicTime begin = rt::now();
  wait_for_end(context, request, **recorder, sources, begin);
  for (const auto& source : sources)
    source->end();
  const std::uint64_t lost_count = lost_count_of(sources);
  const auto closed = (*recorder)->close();
  if (!closed) return context.fail(closed.error());
  return tell_end(context, file, rt::now() - begin, (*recorder)->status(), lost_count);
}

}  // namespace

void add_record(CLI::App& program, Context& context) {
  const auto request = std::make_shared<RecordRequest>();
  CLI::App& command = add_command(
      program, context, "record", "Record the events of a hub, and devices",
      "  rtpm record run.mcap --filter 'type(lab.Touched) or type(rtpm.device.Sampled)'\n"
      "  rtpm record run.mcap --devices lab/knob0 --poll-rate 200\n"
      "Foxglove and others open the file: MCAP with embedded FlatBuffers schemas, a channel per\n"
      "type and source, of a device by its name: lab/arm0/sampled, lab/arm0/description. `rtpm\n"
      "play` re-creates these devices. Ctrl-C ends it; one that was killed is saved by `rtpm bag\n"
      "recover`. What was dropped is counted, shown, and written into the file.\n",
      [request](Context& c) { return record(c, *request); });
  command.add_option("FILE", request->file, "The new file; without: rtpm-DATE-TIME.mcap")
      ->type_name("");
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
  command.add_option("--compression", request->compression, "Of chunks")
      ->check(CLI::IsMember({"zstd", "lz4", "none"}))
      ->capture_default_str();
}

}  // namespace rtpm::tool
