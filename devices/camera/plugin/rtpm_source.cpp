#include <gst/base/gstpushsrc.h>

#include <algorithm>
#include <condition_variable>
#include <deque>
#include <mutex>
#include <optional>
#include <utility>
#include <vector>

#include "elements.hpp"
#include "formats.hpp"
#include "gstreamer.hpp"
#include "rtpm/media/medium_reader.hpp"

namespace rtpm::camerad {
namespace {

/// Pieces that wait for the pipeline beyond it are old: they are dropped.
constexpr std::size_t kWaitingMax = 8;
constexpr unsigned kLatencyMs = 100;

/// The content of an element.
class Source final : public media::MediumSink {
 public:
  struct Piece {
    std::vector<std::byte> bytes{};
    MonotonicTime captured{};
    bool is_key = true;
  };

  expected<void, SetupError> start() {
    caller_.emplace(settings.registry);
    is_flushing_ = false;
    auto started = media::MediumReader::start(
        caller_->node, settings.medium,
        {.wants_video = !is_sound, .wants_sound = is_sound, .window = 2}, *this);
    if (!started) return unexpected{std::move(started.error())};
    reader_.emplace(std::move(*started));
    return {};
  }
  void stop() {
    reader_.reset();
    caller_.reset();
    pieces_.clear();
  }
  /// Ends next(), or lets it wait again.
  void set_flushing(bool is_flushing) {
    const std::lock_guard lock(mutex_);
    is_flushing_ = is_flushing;
    changed_.notify_all();
  }
  /// The next piece; nullopt while flushing.
  std::optional<Piece> next() {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [this] { return is_flushing_ || !pieces_.empty(); });
    if (is_flushing_) return std::nullopt;
    Piece piece = std::move(pieces_.front());
    pieces_.pop_front();
    return piece;
  }
  /// The caps for the pieces, if they have changed.
  std::string take_caps() {
    const std::lock_guard lock(mutex_);
    return std::exchange(caps_, {});
  }

  void on_description(const media::MediumDescriptionT& about) override {
    const std::lock_guard lock(mutex_);
    if (!is_sound && about.video) caps_ = caps_text(*about.video);
    if (is_sound && about.sound) caps_ = caps_text(*about.sound);
  }
  void on_video(const media::ReceivedPiece& piece) override { keep(piece); }
  void on_sound(const media::ReceivedPiece& piece) override { keep(piece); }
  void on_problem(const std::string& problem) override {
    GST_ELEMENT_WARNING(element, RESOURCE, READ, ("%s", problem.c_str()), ("it is tried again"));
  }

  Settings settings{};
  bool is_sound = false;
  unsigned latency_ms = kLatencyMs;
  GstElement* element = nullptr;

 private:
  void keep(const media::ReceivedPiece& piece) {
    const std::lock_guard lock(mutex_);
    needs_key_ = (needs_key_ || pieces_.size() >= kWaitingMax) && !piece.is_key;
    if (needs_key_) return;
    if (piece.is_key && pieces_.size() >= kWaitingMax) pieces_.clear();
    pieces_.push_back({{piece.bytes.begin(), piece.bytes.end()}, piece.captured, piece.is_key});
    changed_.notify_all();
  }

  std::optional<Caller> caller_{};
  std::optional<media::MediumReader> reader_{};
  std::mutex mutex_{};
  std::condition_variable changed_{};
  std::deque<Piece> pieces_{};
  std::string caps_{};
  bool needs_key_ = false;
  bool is_flushing_ = false;
};

struct RtpmSource {
  GstPushSrc parent;
  Source* content;
};
struct RtpmSourceClass {
  GstPushSrcClass parent_class;
};

#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wold-style-cast"
G_DEFINE_TYPE(RtpmSource, rtpm_source, GST_TYPE_PUSH_SRC)
#pragma GCC diagnostic pop

Source& content_of(void* object) {
  return *static_cast<RtpmSource*>(object)->content;
}

void set_property(GObject* object, unsigned id, const GValue* value, GParamSpec* spec) {
  Source& content = content_of(object);
  if (set_setting(content.settings, id, *value)) return;
  if (id == kIsSound) {
    content.is_sound = g_value_get_boolean(value) != FALSE;
  } else if (id == kLatency) {
    content.latency_ms = g_value_get_uint(value);
  } else {
    G_OBJECT_WARN_INVALID_PROPERTY_ID(object, id, spec);
  }
}

void get_property(GObject* object, unsigned id, GValue* value, GParamSpec* spec) {
  const Source& content = content_of(object);
  if (get_setting(content.settings, id, *value)) return;
  if (id == kIsSound) {
    g_value_set_boolean(value, content.is_sound ? TRUE : FALSE);
  } else if (id == kLatency) {
    g_value_set_uint(value, content.latency_ms);
  } else {
    G_OBJECT_WARN_INVALID_PROPERTY_ID(object, id, spec);
  }
}

gboolean start(GstBaseSrc* source) {
  const auto started = content_of(source).start();
  if (started) return TRUE;
  GST_ELEMENT_ERROR(source, RESOURCE, OPEN_READ, ("%s", started.error().text().c_str()),
                    ("medium of RTPM"));
  return FALSE;
}

gboolean stop(GstBaseSrc* source) {
  content_of(source).stop();
  return TRUE;
}

gboolean unlock(GstBaseSrc* source) {
  content_of(source).set_flushing(true);
  return TRUE;
}

gboolean unlock_stop(GstBaseSrc* source) {
  content_of(source).set_flushing(false);
  return TRUE;
}

gboolean query(GstBaseSrc* source, GstQuery* query) {
  if (GST_QUERY_TYPE(query) != GST_QUERY_LATENCY)
    return GST_BASE_SRC_CLASS(rtpm_source_parent_class)->query(source, query);
  gst_query_set_latency(query, TRUE, content_of(source).latency_ms * GST_MSECOND,
                        GST_CLOCK_TIME_NONE);
  return TRUE;
}

/// Times are the pipeline's running time, so its clock must be the system's monotonic one, as by
/// default where no sound card gives another.
GstFlowReturn create(GstPushSrc* source, GstBuffer** buffer) {
  Source& content = content_of(source);
  const auto piece = content.next();
  if (!piece) return GST_FLOW_FLUSHING;
  if (const std::string text = content.take_caps(); !text.empty()) {
    const Owned<GstCaps> caps(gst_caps_from_string(text.c_str()));
    if (gst_base_src_set_caps(GST_BASE_SRC(source), caps.get()) == FALSE)
      return GST_FLOW_NOT_NEGOTIATED;
  }
  *buffer = gst_buffer_new_memdup(piece->bytes.data(), piece->bytes.size());
  const auto base = static_cast<std::int64_t>(gst_element_get_base_time(GST_ELEMENT(source)));
  GST_BUFFER_PTS(*buffer) =
      static_cast<GstClockTime>(std::max<std::int64_t>(0, to_ns(piece->captured) - base));
  if (!piece->is_key) GST_BUFFER_FLAG_SET(*buffer, GST_BUFFER_FLAG_DELTA_UNIT);
  return GST_FLOW_OK;
}

void finalize(GObject* object) {
  delete static_cast<RtpmSource*>(static_cast<void*>(object))->content;
  G_OBJECT_CLASS(rtpm_source_parent_class)->finalize(object);
}

void rtpm_source_init(RtpmSource* source) {
  source->content = new Source;
  source->content->element = GST_ELEMENT(source);
  gst_base_src_set_live(GST_BASE_SRC(source), TRUE);
  gst_base_src_set_format(GST_BASE_SRC(source), GST_FORMAT_TIME);
}

void rtpm_source_class_init(RtpmSourceClass* type) {
  auto* const object_class = G_OBJECT_CLASS(type);
  object_class->set_property = &set_property;
  object_class->get_property = &get_property;
  object_class->finalize = &finalize;
  install_settings(*object_class);
  constexpr auto kFlags = static_cast<GParamFlags>(G_PARAM_READWRITE | G_PARAM_STATIC_STRINGS);
  g_object_class_install_property(
      object_class, kIsSound,
      g_param_spec_boolean("sound", "sound", "Gives the sound, not the pictures", FALSE, kFlags));
  g_object_class_install_property(
      object_class, kLatency,
      g_param_spec_uint("latency", "latency",
                        "The latency that it answers, in milliseconds: from a capture to here", 0,
                        60'000, kLatencyMs, kFlags));
  auto* const element_class = GST_ELEMENT_CLASS(type);
  gst_element_class_set_static_metadata(element_class, "RTPM source", "Source/Network",
                                        "Pictures or sound of a medium of RTPM", "RTPM");
  const std::string caps = std::string(kVideoCaps) + "; " + kSoundCaps;
  const Owned<GstCaps> offered(gst_caps_from_string(caps.c_str()));
  gst_element_class_add_pad_template(
      element_class, gst_pad_template_new("src", GST_PAD_SRC, GST_PAD_ALWAYS, offered.get()));
  auto* const base_class = GST_BASE_SRC_CLASS(type);
  base_class->start = &start;
  base_class->stop = &stop;
  base_class->unlock = &unlock;
  base_class->unlock_stop = &unlock_stop;
  base_class->query = &query;
  GST_PUSH_SRC_CLASS(type)->create = &create;
}

}  // namespace

GType source_type() noexcept {
  return rtpm_source_get_type();
}

}  // namespace rtpm::camerad
