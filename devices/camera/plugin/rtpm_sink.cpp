#include <gst/base/gstbasesink.h>
#include <gst/video/video-event.h>

#include <memory>
#include <optional>
#include <string_view>
#include <utility>

#include "elements.hpp"
#include "formats.hpp"
#include "gstreamer.hpp"
#include "rtpm/media/medium_server.hpp"
#include "rtpm/names/registration.hpp"
#include "rtpm/rpc/server.hpp"

namespace rtpm::camerad {
namespace {

/// The content of an element: a server of one medium, for callers on this host.
class Sink {
 public:
  expected<void, SetupError> start() {
    media::MediumDescriptionT about;
    about.model = "GStreamer";
    about.serial = settings.medium;
    about.frame = settings.medium;
    medium_ = std::make_unique<media::MediumServer>(std::move(about));
    caller_.emplace(settings.registry);
    auto server = rpc::Server::create({.name = "rtpmsink",
                                       .lanes = {{.name = "lane-media"}},
                                       .realtime = rt::RealtimeMode::kOff});
    if (!server) return unexpected{std::move(server.error())};
    server_ = std::move(*server);
    if (auto added = server_->add(settings.medium, *medium_); !added) return added;
    return server_->start();
  }
  void stop() {
    registration_.reset();
    if (server_) server_->stop();
    server_.reset();
    caller_.reset();
    medium_.reset();
  }
  /// Notes the format, and binds the name, as the medium is complete with the first one.
  expected<void, SetupError> set_format(const GstStructure& structure) {
    is_sound_ = std::string_view(gst_structure_get_name(&structure)).starts_with("audio/");
    if (is_sound_) {
      medium_->set_sound(sound_format(structure));
    } else {
      medium_->set_video(video_format(structure));
    }
    medium_->begin();
    if (registration_) return {};
    auto bound = names::Registration::create(
        caller_->node, settings.registry, settings.medium, server_->url(settings.medium),
        std::string(medium_->interface().name), names::Registration::kDefaultLease, {},
        names::Takeover::kRefused, {{"class", is_sound_ ? "microphone" : "camera"}});
    if (!bound) return unexpected{std::move(bound.error())};
    registration_ = std::move(*bound);
    return {};
  }
  /// @return whether the encoder should be asked for a key frame
  bool push(const media::Piece& piece) {
    if (!is_sound_) return medium_->push_video(piece);
    medium_->push_sound(piece);
    return false;
  }

  Settings settings{};

 private:
  std::optional<Caller> caller_{};
  std::unique_ptr<media::MediumServer> medium_{};
  std::unique_ptr<rpc::Server> server_{};
  std::unique_ptr<names::Registration> registration_{};
  bool is_sound_ = false;
};

struct RtpmSink {
  GstBaseSink parent;
  Sink* content;
};
struct RtpmSinkClass {
  GstBaseSinkClass parent_class;
};

#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wold-style-cast"
G_DEFINE_TYPE(RtpmSink, rtpm_sink, GST_TYPE_BASE_SINK)
#pragma GCC diagnostic pop

Sink& content_of(void* object) {
  return *static_cast<RtpmSink*>(object)->content;
}

void set_property(GObject* object, unsigned id, const GValue* value, GParamSpec* spec) {
  if (set_setting(content_of(object).settings, id, *value)) return;
  G_OBJECT_WARN_INVALID_PROPERTY_ID(object, id, spec);
}

void get_property(GObject* object, unsigned id, GValue* value, GParamSpec* spec) {
  if (get_setting(content_of(object).settings, id, *value)) return;
  G_OBJECT_WARN_INVALID_PROPERTY_ID(object, id, spec);
}

gboolean report(GstBaseSink* sink, const expected<void, SetupError>& done) {
  if (done) return TRUE;
  GST_ELEMENT_ERROR(sink, RESOURCE, OPEN_WRITE, ("%s", done.error().text().c_str()),
                    ("medium of RTPM"));
  return FALSE;
}

gboolean start(GstBaseSink* sink) {
  return report(sink, content_of(sink).start());
}

gboolean stop(GstBaseSink* sink) {
  content_of(sink).stop();
  return TRUE;
}

gboolean set_caps(GstBaseSink* sink, GstCaps* caps) {
  return report(sink, content_of(sink).set_format(*gst_caps_get_structure(caps, 0)));
}

GstFlowReturn render(GstBaseSink* sink, GstBuffer* buffer) {
  const GstClockTime running =
      gst_segment_to_running_time(&sink->segment, GST_FORMAT_TIME, GST_BUFFER_PTS(buffer));
  if (!GST_CLOCK_TIME_IS_VALID(running)) {
    GST_ELEMENT_ERROR(sink, STREAM, FORMAT, ("its buffers have no time"),
                      ("let the source stamp them, such as by do-timestamp=true"));
    return GST_FLOW_ERROR;
  }
  const GstClockTime base = gst_element_get_base_time(GST_ELEMENT(sink));
  const Mapped mapped(*buffer);
  const media::Piece piece{.bytes = mapped.bytes(),
                           .captured = time_from_ns(static_cast<std::int64_t>(base + running)),
                           .uncertainty = duration_of(*buffer),
                           .is_key = !GST_BUFFER_FLAG_IS_SET(buffer, GST_BUFFER_FLAG_DELTA_UNIT)};
  if (content_of(sink).push(piece)) {
    const auto force = gst_video_event_new_upstream_force_key_unit(GST_CLOCK_TIME_NONE, TRUE, 0);
    static_cast<void>(gst_pad_push_event(GST_BASE_SINK_PAD(sink), force));
  }
  return GST_FLOW_OK;
}

void finalize(GObject* object) {
  delete static_cast<RtpmSink*>(static_cast<void*>(object))->content;
  G_OBJECT_CLASS(rtpm_sink_parent_class)->finalize(object);
}

void rtpm_sink_init(RtpmSink* sink) {
  sink->content = new Sink;
  gst_base_sink_set_sync(GST_BASE_SINK(sink), FALSE);
}

void rtpm_sink_class_init(RtpmSinkClass* type) {
  auto* const object_class = G_OBJECT_CLASS(type);
  object_class->set_property = &set_property;
  object_class->get_property = &get_property;
  object_class->finalize = &finalize;
  install_settings(*object_class);
  auto* const element_class = GST_ELEMENT_CLASS(type);
  gst_element_class_set_static_metadata(element_class, "RTPM sink", "Sink/Network",
                                        "Serves pictures or sound as a medium of RTPM", "RTPM");
  const std::string caps = std::string(kVideoCaps) + "; " + kSoundCaps;
  const Owned<GstCaps> accepted(gst_caps_from_string(caps.c_str()));
  gst_element_class_add_pad_template(
      element_class, gst_pad_template_new("sink", GST_PAD_SINK, GST_PAD_ALWAYS, accepted.get()));
  auto* const base_class = GST_BASE_SINK_CLASS(type);
  base_class->start = &start;
  base_class->stop = &stop;
  base_class->set_caps = &set_caps;
  base_class->render = &render;
}

}  // namespace

GType sink_type() noexcept {
  return rtpm_sink_get_type();
}

}  // namespace rtpm::camerad
