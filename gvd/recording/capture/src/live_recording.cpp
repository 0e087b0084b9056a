#include "rtpm/capture/live_recording.hpp"

#include <algorithm>
#include <cstdio>
#include <mutex>
#include <span>
#include <utility>

#include "rtpm/capture/channels.hpp"
#include "rtpm/capture/clock_survey.hpp"
#include "rtpm/capture/hub_recorder.hpp"
#include "rtpm/capture/medium_recorder.hpp"
#include "rtpm/capture/parameters.hpp"
#include "rtpm/events/hub_types.hpp"
#include "rtpm/names/directory.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/pi_mutex.hpp"
#include "rtpm/rt/semaphore.hpp"
#include "rtpm/rt/thread.hpp"

namespace rtpm::capture {
namespace {

/// Interval of look-ups of unknown types and names.
constexpr Duration kPeriod = std::chrono::milliseconds{200};
constexpr std::size_t kReportCountMax = 32;

/// The text as a JSON string. Bytes above ASCII are kept.
std::string quoted(std::string_view text) {
  std::string json = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') {
      json += '\\';
      json += c;
    } else if (static_cast<unsigned char>(c) < 0x20) {
      constexpr std::string_view kDigits = "0123456789abcdef";
      json += "\\u00";
      json += kDigits[static_cast<unsigned char>(c) >> 4];
      json += kDigits[static_cast<unsigned char>(c) & 15];
    } else {
      json += c;
    }
  }
  return json + "\"";
}

expected<std::uint16_t, SetupError> add_annotations(recording::Recorder& recorder) {
  constexpr std::string_view kSchema =
      R"({"type": "object", "properties": {"text": {"type": "string"}}})";
  const auto bytes = std::as_bytes(std::span(kSchema));
  const auto schema = recorder.add_schema(
      {.name = "rtpm.Annotation", .encoding = "jsonschema", .data = {bytes.begin(), bytes.end()}});
  if (!schema) return schema;
  return recorder.add_channel(
      {.schema_id = *schema, .topic = kAnnotationTopic, .message_encoding = "json"});
}

}  // namespace

struct LiveRecording::Impl {
  Impl(rpc::Node& node, std::unique_ptr<recording::Recorder> opened, std::uint16_t channel)
      : clocks(node),
        recorder(std::move(opened)),
        annotations(recorder->add_track()),
        annotation_channel(channel) {}
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;
  ~Impl() { static_cast<void>(stop()); }

  expected<void, SetupError> start(rpc::Node& node, events::HubTypes types,
                                   const LiveRecordingConfig& config, events::Filter filter) {
    static_cast<void>(recorder->write(versions_metadata()));
    if (config.session) static_cast<void>(recorder->write(session_metadata(*config.session)));
    auto reading =
        ParameterRecorder::start(node, *recorder, {.hub = config.hub, .devices = config.devices});
    if (!reading) return unexpected{reading.error()};
    parameters = std::move(*reading);
    auto created = HubRecorder::create(node, *recorder, std::move(types),
                                       {.hub = config.hub,
                                        .registry = config.registry,
                                        .deadline = config.deadline,
                                        .filter = std::move(filter),
                                        .parameters = parameters.get()});
    if (!created) return unexpected{created.error()};
    hub = std::move(*created);
    for (const std::string& name : config.media) {
      auto medium = MediumRecorder::start(node, *recorder, name);
      if (!medium) return setup_error(name, std::move(medium.error()));
      media.push_back(std::move(*medium));
    }
    add_clocks(node, config);
    auto begun = rt::Thread::start({.name = "rtpm-record", .realtime = rt::RealtimeMode::kOff},
                                   [this] { run(); });
    if (!begun) return unexpected{begun.error()};
    thread = std::move(*begun);
    return {};
  }

  void run() {
    write_clocks("begin");
    while (!ending.wait_until(rt::now() + kPeriod)) {
      hub->attend();
      take_reports();
    }
    write_clocks("end");
  }
  void take_reports() {
    const std::lock_guard lock(mutex);
    for (std::string& text : parameters->take_reports()) {
      if (reports.size() < kReportCountMax) reports.push_back(std::move(text));
    }
  }

  void add_clocks(rpc::Node& node, const LiveRecordingConfig& config) {
    if (const auto url = names::url_of(node, config.registry, config.hub)) {
      clocks.add(config.hub, *url);
    }
    static_cast<void>(clocks.add_devices(config.registry));  // HubRecorder reports it.
  }
  void write_clocks(std::string_view when) {
    clocks.measure();
    static_cast<void>(recorder->write(clock_metadata(clocks, *recorder, when)));
  }

  bool annotate(std::string_view text) {
    const std::string json = "{\"text\": " + quoted(text) + "}";
    const std::lock_guard lock(mutex);
    const std::uint64_t time_ns = recorder->log_time_ns(rt::now());
    return annotations.put({.channel_id = annotation_channel,
                            .sequence = ++annotation_count,
                            .log_time_ns = time_ns,
                            .publish_time_ns = time_ns,
                            .data = std::as_bytes(std::span(json))});
  }

  expected<void, SetupError> stop() {
    if (thread.is_running()) {
      ending.post();
      thread.join();
      hub->finish();
      parameters->stop();
      take_reports();
      for (const auto& medium : media)
        medium->stop();
    }
    // Where the thread did not start, it still records.
    if (parameters) parameters->stop();
    return recorder->close();
  }

  MonotonicTime begin = rt::now();
  ClockSurvey clocks;
  std::unique_ptr<recording::Recorder> recorder;
  rt::PiMutex mutex{};
  recording::Recorder::Track& annotations;  ///< Guarded by `mutex`.
  std::uint16_t annotation_channel;
  std::uint32_t annotation_count = 0;
  std::unique_ptr<ParameterRecorder> parameters{};  ///< Outlives `hub`, which adds devices.
  std::unique_ptr<HubRecorder> hub{};
  std::vector<std::unique_ptr<MediumRecorder>> media{};
  std::vector<std::string> reports{};  ///< Guarded by `mutex`.
  rt::Semaphore ending{};
  rt::Thread thread{};
};

expected<std::unique_ptr<LiveRecording>, SetupError> LiveRecording::start(
    rpc::Node& node, const std::string& file, LiveRecordingConfig config) {
  if (config.session) {
    if (auto checked = check(*config.session); !checked) return unexpected{checked.error()};
  }
  // If the hub does not answer, no file is created.
  auto types = events::HubTypes::ask(node, config.hub, config.deadline);
  if (!types) return unexpected{types.error()};
  auto filter = selection_of(*types, config.devices, config.topics);
  if (!filter) return unexpected{filter.error()};
  if (!config.media.empty()) {
    recording::RecorderConfig& sizes = config.recorder;
    sizes.message_byte_max = std::max(sizes.message_byte_max, kPictureByteMax);
    sizes.ring_byte_count = std::max(sizes.ring_byte_count, 4 * kPictureByteMax);
  }
  auto recorder = recording::Recorder::create(file, config.recorder);
  if (!recorder) return unexpected{recorder.error()};
  const auto channel = add_annotations(**recorder);
  if (!channel) return unexpected{channel.error()};
  auto impl = std::make_unique<Impl>(node, std::move(*recorder), *channel);
  auto started = impl->start(node, std::move(*types), config, std::move(*filter));
  if (!started) {
    impl.reset();
    static_cast<void>(std::remove(file.c_str()));  // It has no events.
    return unexpected{started.error()};
  }
  return std::unique_ptr<LiveRecording>(new LiveRecording(std::move(impl)));
}

LiveRecording::LiveRecording(std::unique_ptr<Impl> impl) noexcept : impl_(std::move(impl)) {}
LiveRecording::~LiveRecording() = default;

bool LiveRecording::annotate(std::string_view text) {
  return impl_->annotate(text);
}

recording::Recorder& LiveRecording::recorder() noexcept {
  return *impl_->recorder;
}

LiveRecordingStatus LiveRecording::status() const {
  std::uint64_t lost_pieces = 0;
  const std::lock_guard lock(impl_->mutex);
  for (const auto& medium : impl_->media)
    lost_pieces += medium->status().lost_count;
  return {.time = rt::now() - impl_->begin,
          .recorder = impl_->recorder->status(),
          .lost_count = impl_->hub->lost_count() + lost_pieces,
          .undescribed_devices = impl_->hub->undescribed_devices(),
          .reports = impl_->reports};
}

expected<void, SetupError> LiveRecording::stop() {
  return impl_->stop();
}

}  // namespace rtpm::capture
