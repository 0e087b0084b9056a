#include "test_source.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "bar_code.hpp"
#include "rtpm/gvd/client.hpp"
#include "rtpm/rt/clock.hpp"

namespace rtpm::camerad {
namespace {

constexpr const char* kPictureCaps =
    "video/x-raw, format=I420, width=640, height=480, framerate=30/1";
constexpr const char* kSoundCaps =
    "audio/x-raw, format=S16LE, layout=interleaved, rate=48000, channels=1";
constexpr double kToneHz = 1000;
constexpr double kToneHeight = 8000;
constexpr Duration kRetry = std::chrono::milliseconds{1};

}  // namespace

/// The first button of a device, read until it is known at a time.
class TestSource::Button {
 public:
  explicit Button(gvd::DeviceClient* device) : device_(device) {}

  /// Whether it was pressed within kLit before `time`; nullopt if that is not known at `latest`.
  std::optional<bool> is_lit(MonotonicTime time, MonotonicTime latest) {
    if (device_ == nullptr) return false;
    while (rt::now() < latest) {
      const auto sample = device_->read();
      // A device that is not there lights nothing; it may come back.
      if (!sample) return false;
      if (sample->host_time < time) {
        rt::sleep_until(std::min(latest, rt::now() + kRetry));
        continue;
      }
      const int edge_count = sample->button_edges[0];
      const bool is_new = edge_count_ && *edge_count_ != edge_count;
      // Two edges are a press as well: it was released again.
      if (is_new && ((sample->buttons & 1) != 0 || ((edge_count - *edge_count_) & 0xffff) > 1))
        pressed_ = time;
      edge_count_ = edge_count;
      return pressed_ && time < *pressed_ + kLit;
    }
    return std::nullopt;
  }

 private:
  gvd::DeviceClient* device_;
  std::optional<int> edge_count_{};
  std::optional<MonotonicTime> pressed_{};
};

TestSource::Feed::Feed() = default;
TestSource::Feed::~Feed() = default;

TestSource::TestSource(const Pipeline& pipeline) noexcept : pipeline_(pipeline) {}

expected<std::unique_ptr<TestSource>, SetupError> TestSource::start(const Pipeline& pipeline,
                                                                    rpc::Node& node,
                                                                    const std::string& device) {
  std::unique_ptr<TestSource> source(new TestSource(pipeline));
  source->video_.source = pipeline.element("test_video");
  source->sound_.source = pipeline.element("test_sound");
  if (source->video_.source == nullptr && source->sound_.source == nullptr)
    return std::unique_ptr<TestSource>();
  if (!device.empty()) {
    auto opened = gvd::DeviceClient::open(node, device);
    if (!opened) return setup_error("the button " + device, std::move(opened.error()));
    source->device_ = std::make_unique<gvd::DeviceClient>(std::move(*opened));
  }
  auto started = source->start(source->video_, kPictureCaps, &TestSource::show);
  if (started) started = source->start(source->sound_, kSoundCaps, &TestSource::sound);
  if (!started) return unexpected{std::move(started.error())};
  return source;
}

expected<void, SetupError> TestSource::start(Feed& feed, const char* caps_text,
                                             void (TestSource::*run)(Feed&)) {
  if (feed.source == nullptr) return {};
  if (!GST_IS_APP_SRC(feed.source.get())) {
    return setup_error("the elements test_video and test_sound are for the test picture", "",
                       "make them appsrc, or give them other names");
  }
  const Owned<GstCaps> caps(gst_caps_from_string(caps_text));
  // Pushing never waits: what the pipeline does not take is old.
  g_object_set(feed.source.get(), "caps", caps.get(), "format", GST_FORMAT_TIME, "is-live", TRUE,
               "max-buffers", guint64{2}, "leaky-type", 2, nullptr);
  feed.button = std::make_unique<Button>(device_.get());
  auto thread = rt::Thread::start({.name = "rtpm-test-feed", .realtime = rt::RealtimeMode::kOff},
                                  [this, &feed, run] { (this->*run)(feed); });
  if (!thread) return unexpected{std::move(thread.error())};
  feed.thread = std::move(*thread);
  return {};
}

TestSource::~TestSource() {
  for (Feed* feed : {&video_, &sound_}) {
    feed->ending.post();
    if (feed->thread.is_running()) feed->thread.join();
  }
}

// Gives a buffer of `make(time, is_lit)` for each multiple of the period, `delay` after it.
template <class Make>
void TestSource::give(Feed& feed, Duration period, Duration delay, Make make) {
  std::int64_t count = rt::now().time_since_epoch() / period + 1;
  while (!feed.ending.wait_until(MonotonicTime{count * period})) {
    const MonotonicTime time{count * period};
    const auto is_lit = feed.button->is_lit(time, time + period);
    count = std::max<std::int64_t>(count + 1, rt::now().time_since_epoch() / period);
    if (!is_lit) continue;
    if (delay > Duration{0} && feed.ending.wait_until(time + delay)) return;
    const auto base =
        static_cast<std::int64_t>(gst_element_get_base_time(GST_ELEMENT(&pipeline_.bin())));
    // Before it plays, the pipeline has no base time.
    if (base == 0 || to_ns(time) < base) continue;
    GstBuffer* const buffer = make(time, *is_lit);
    GST_BUFFER_PTS(buffer) = static_cast<GstClockTime>(to_ns(time) - base);
    GST_BUFFER_DURATION(buffer) = static_cast<GstClockTime>(period.count());
    static_cast<void>(gst_app_src_push_buffer(GST_APP_SRC(feed.source.get()), buffer));
  }
}

void TestSource::show(Feed& feed) {
  constexpr std::size_t kPixelCount = std::size_t{kWidth} * kHeight;
  std::vector<std::uint8_t> picture(kPixelCount * 3 / 2, 128);
  const Luma luma{std::span(picture).first(kPixelCount), kWidth, kHeight};
  give(feed, Duration{std::chrono::seconds{1}} / kPictureRateHz, Duration{0},
       [&](MonotonicTime time, bool is_lit) {
         paint_number(luma, static_cast<std::uint64_t>(to_ns(time)));
         paint_lamp(luma, is_lit);
         return gst_buffer_new_memdup(picture.data(), picture.size());
       });
}

void TestSource::sound(Feed& feed) {
  constexpr std::size_t kSampleCount = kSampleRateHz / kSoundRateHz;
  std::vector<std::int16_t> tone(kSampleCount);
  for (std::size_t i = 0; i < kSampleCount; ++i) {
    tone[i] = static_cast<std::int16_t>(
        kToneHeight * std::sin(2 * std::numbers::pi * kToneHz * static_cast<double>(i) /
                               static_cast<double>(kSampleRateHz)));
  }
  const std::vector<std::int16_t> silence(kSampleCount);
  // A piece of sound is complete at its end.
  constexpr Duration kPeriod = Duration{std::chrono::seconds{1}} / kSoundRateHz;
  give(feed, kPeriod, kPeriod, [&](MonotonicTime, bool is_lit) {
    const auto& samples = is_lit ? tone : silence;
    return gst_buffer_new_memdup(samples.data(), samples.size() * sizeof(std::int16_t));
  });
}

}  // namespace rtpm::camerad
