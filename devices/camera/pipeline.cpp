#include "pipeline.hpp"

#include <gst/video/video-event.h>

#include <algorithm>
#include <utility>

#include "formats.hpp"
#include "pipeline_error.hpp"
#include "rtpm/rt/clock.hpp"

namespace rtpm::camerad {
namespace {

/// A piece from the future comes of a source that does not run with time, such as a file.
constexpr Duration kAheadMax = std::chrono::milliseconds{100};

/// Ends the pipeline with an error of `sink`.
GstFlowReturn fail(GstElement* sink, const char* what, const char* remedy) {
  GST_ELEMENT_ERROR(sink, STREAM, FORMAT, ("%s", what), ("%s", remedy));
  return GST_FLOW_ERROR;
}

}  // namespace

expected<std::unique_ptr<Pipeline>, SetupError> Pipeline::create(const std::string& text,
                                                                 Duration uncertainty,
                                                                 media::MediumServer& server) {
  GError* problem = nullptr;
  GstElement* const made =
      gst_parse_launch_full(text.c_str(), nullptr, GST_PARSE_FLAG_FATAL_ERRORS, &problem);
  const Owned<GError> error(problem);
  // The reference that a new element has is floating.
  Owned<GstElement> element(made == nullptr ? nullptr : GST_ELEMENT(gst_object_ref_sink(made)));
  if (error != nullptr) return unexpected{parse_error(*error)};
  std::unique_ptr<Pipeline> pipeline;
  if (element != nullptr && GST_IS_PIPELINE(element.get()))
    pipeline.reset(new Pipeline(std::move(element), uncertainty, server));
  if (pipeline == nullptr ||
      (pipeline->video_.sink == nullptr && pipeline->sound_.sink == nullptr)) {
    return setup_error("its pipeline gives nothing", "it has no appsink named video or sound",
                       "end it with ! appsink name=video, or ! appsink name=sound");
  }
  return pipeline;
}

Pipeline::Pipeline(Owned<GstElement> pipeline, Duration uncertainty, media::MediumServer& server)
    : pipeline_(std::move(pipeline)),
      bus_(gst_element_get_bus(pipeline_.get())),
      uncertainty_(uncertainty),
      server_(server) {
  // Sound cards would give a clock of their own.
  const Owned<GstClock> clock(GST_CLOCK(
      g_object_new(GST_TYPE_SYSTEM_CLOCK, "clock-type", GST_CLOCK_TYPE_MONOTONIC, nullptr)));
  gst_pipeline_use_clock(GST_PIPELINE(pipeline_.get()), clock.get());
  video_.is_video = true;
  connect(video_, "video", kVideoCaps);
  connect(sound_, "sound", kSoundCaps);
  if (video_.sink != nullptr) server_.set_video({});
  if (sound_.sink != nullptr) server_.set_sound({});
}

Pipeline::~Pipeline() {
  static_cast<void>(gst_element_set_state(pipeline_.get(), GST_STATE_NULL));
}

void Pipeline::connect(Outlet& outlet, const char* name, const char* caps) {
  Owned<GstElement> sink = element(name);
  if (sink == nullptr || !GST_IS_APP_SINK(sink.get())) return;
  outlet.pipeline = this;
  const Owned<GstCaps> accepted(gst_caps_from_string(caps));
  // A branch without a picture yet must not keep the other one from starting.
  g_object_set(sink.get(), "sync", FALSE, "async", FALSE, "max-buffers", 2U, "drop", TRUE,
               "enable-last-sample", FALSE, "caps", accepted.get(), nullptr);
  GstAppSinkCallbacks callbacks{};
  callbacks.new_sample = &Pipeline::on_sample;
  gst_app_sink_set_callbacks(GST_APP_SINK(sink.get()), &callbacks, &outlet, nullptr);
  outlet.sink = std::move(sink);
}

Owned<GstElement> Pipeline::element(const std::string& name) const {
  return Owned<GstElement>(gst_bin_get_by_name(&bin(), name.c_str()));
}

void Pipeline::play() {
  static_cast<void>(gst_element_set_state(pipeline_.get(), GST_STATE_PLAYING));
}

std::optional<SetupError> Pipeline::wait_for_end(MonotonicTime until) {
  const Duration left = std::max(until - rt::now(), Duration{0});
  const Owned<GstMessage> message(
      gst_bus_timed_pop_filtered(bus_.get(), static_cast<GstClockTime>(left.count()),
                                 static_cast<GstMessageType>(GST_MESSAGE_ERROR | GST_MESSAGE_EOS)));
  if (message == nullptr) {
    if (!has_latency_ && piece_count() > 0) learn_latency();
    return std::nullopt;
  }
  if (GST_MESSAGE_TYPE(message.get()) == GST_MESSAGE_ERROR) return run_error(*message);
  return SetupError{"its pipeline has ended", "its source gives no more",
                    "take a source that does not end; it is started again"};
}

GstFlowReturn Pipeline::on_sample(GstAppSink* sink, void* outlet) {
  auto& own = *static_cast<Outlet*>(outlet);
  const Owned<GstSample> sample(gst_app_sink_pull_sample(sink));
  if (sample == nullptr) return GST_FLOW_EOS;
  return own.pipeline->take(own, *sample);
}

GstFlowReturn Pipeline::take(Outlet& outlet, GstSample& sample) {
  GstBuffer* const buffer = gst_sample_get_buffer(&sample);
  GstCaps* const caps = gst_sample_get_caps(&sample);
  if (buffer == nullptr || caps == nullptr) return GST_FLOW_OK;
  if (caps != outlet.caps.get()) learn_format(outlet, *caps);
  // Encoders may shift PTS; the segment shifts them back.
  const GstClockTime running = gst_segment_to_running_time(gst_sample_get_segment(&sample),
                                                           GST_FORMAT_TIME, GST_BUFFER_PTS(buffer));
  if (!GST_CLOCK_TIME_IS_VALID(running)) {
    return fail(outlet.sink.get(), "its buffers have no time",
                "let the source stamp them, such as by do-timestamp=true");
  }
  const GstClockTime base = gst_element_get_base_time(pipeline_.get());
  const MonotonicTime captured = time_from_ns(static_cast<std::int64_t>(base + running));
  if (captured > rt::now() + kAheadMax) {
    return fail(
        outlet.sink.get(), "its pictures or sounds are from the future",
        "make its source a live one, such as by is-live=true, or add the element clocksync");
  }
  const Duration duration = std::max(duration_of(*buffer), outlet.period);
  const Mapped mapped(*buffer);
  const media::Piece piece{.bytes = mapped.bytes(),
                           .captured = captured,
                           .uncertainty = uncertainty_ > Duration{0} ? uncertainty_ : duration,
                           .is_key = !GST_BUFFER_FLAG_IS_SET(buffer, GST_BUFFER_FLAG_DELTA_UNIT)};
  piece_count_.fetch_add(1, std::memory_order_relaxed);
  if (!outlet.is_video) {
    server_.push_sound(piece);
  } else if (server_.push_video(piece)) {
    const auto force = gst_video_event_new_upstream_force_key_unit(GST_CLOCK_TIME_NONE, TRUE, 0);
    // JPEG encoders take no such event, and need none.
    static_cast<void>(gst_element_send_event(outlet.sink.get(), force));
  }
  return GST_FLOW_OK;
}

void Pipeline::learn_format(Outlet& outlet, GstCaps& caps) {
  outlet.caps.reset(gst_caps_ref(&caps));
  const GstStructure* const structure = gst_caps_get_structure(&caps, 0);
  if (!outlet.is_video) return server_.set_sound(sound_format(*structure));
  const media::VideoFormatT format = video_format(*structure);
  if (format.rate_hz > 0) {
    outlet.period =
        std::chrono::duration_cast<Duration>(std::chrono::duration<double>(1 / format.rate_hz));
  }
  server_.set_video(format);
}

void Pipeline::learn_latency() {
  has_latency_ = true;
  const Owned<GstQuery> query(gst_query_new_latency());
  if (gst_element_query(pipeline_.get(), query.get()) == FALSE) return;
  gboolean is_live = FALSE;
  GstClockTime low = 0;
  GstClockTime high = 0;
  gst_query_parse_latency(query.get(), &is_live, &low, &high);
  if (is_live != FALSE && GST_CLOCK_TIME_IS_VALID(low))
    server_.set_latency(Duration{static_cast<std::int64_t>(low)});
}

}  // namespace rtpm::camerad
