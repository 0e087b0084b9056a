#include <gst/app/gstappsink.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <device_events.rtpm.events.hpp>
#include <fstream>
#include <iterator>
#include <sstream>
#include <string>
#include <vector>

#include "bar_code.hpp"
#include "gstreamer.hpp"
#include "programs.hpp"
#include "rtpm/recording/file_reader.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/test/os.hpp"
#include "rtpm/test/temporary_folder.hpp"
#include "rtpm/viewers/pictures.hpp"
#include "test_source.hpp"

// Cameras of a laboratory: the test picture's bar code and lamp in recordings and exported files,
// bad pipelines.
namespace rtpm::system_test {
namespace {

using camerad::TestSource;

constexpr std::uint64_t kPictureNs = 1'000'000'000 / TestSource::kPictureRateHz;
constexpr std::uint64_t kSoundNs = 1'000'000'000 / TestSource::kSoundRateHz;

/// A camera and a button in a recording, by log time.
struct Recorded {
  std::vector<std::uint64_t> presses{};   ///< When the button was pressed.
  std::vector<std::uint64_t> pictures{};  ///< When each picture was captured.
  std::vector<std::uint64_t> sounds{};
  std::vector<bool> tones{};  ///< Whether each piece of sound has the tone.
  std::uint64_t uncertainty_ns = 0;
};

bool has_tone(ConstBytes samples) {
  std::int16_t peak = 0;
  for (std::size_t i = 0; i + 1 < samples.size(); i += 2) {
    const auto sample = static_cast<std::int16_t>(std::to_integer<unsigned>(samples[i]) |
                                                  std::to_integer<unsigned>(samples[i + 1]) << 8);
    peak = std::max(peak, sample);
  }
  return peak > 1000;
}

Recorded read(recording::FileReader& reader) {
  Recorded recorded;
  const auto topic_of = [&](const recording::Message& message) {
    return reader.channels().at(message.channel_id).topic;
  };
  for (const auto& [number, channel] : reader.channels()) {
    if (channel.topic == "lab/cam0/video") {
      EXPECT_EQ(reader.schemas().at(channel.schema_id).name, "foxglove.CompressedVideo");
      recorded.uncertainty_ns = std::stoull(channel.metadata.at("rtpm.uncertainty_ns"));
    }
  }
  const auto done = reader.read({}, [&](const recording::Message& message) {
    const std::string topic = topic_of(message);
    if (topic == "lab/arm0/button_changed") {
      const auto* const event = flatbuffers::GetRoot<device::ButtonChanged>(message.data.data());
      if (event->change()->is_pressed()) recorded.presses.push_back(message.publish_time_ns);
    } else if (topic == "lab/cam0/video") {
      recorded.pictures.push_back(message.log_time_ns);
    } else if (topic == "lab/cam0/sound") {
      const auto sound = viewers::sound_in(message.data);
      EXPECT_TRUE(sound);
      recorded.sounds.push_back(message.log_time_ns);
      recorded.tones.push_back(sound && has_tone(sound->data));
    }
    return true;
  });
  EXPECT_TRUE(done) << done.error().text();
  return recorded;
}

/// Checks that each press shows as a beginning of `is_lit`, and at the right time.
void expect_shown(const std::vector<std::uint64_t>& times, const std::vector<bool>& is_lit,
                  const std::vector<std::uint64_t>& presses, std::uint64_t period_ns,
                  std::uint64_t uncertainty_ns) {
  ASSERT_EQ(times.size(), is_lit.size());
  std::size_t shown_count = 0;
  for (std::size_t i = 1; i < times.size(); ++i) {
    if (!is_lit[i] || is_lit[i - 1]) continue;
    ++shown_count;
    // A picture that was left out makes the step before it longer.
    const std::uint64_t low = times[i - 1] - uncertainty_ns;
    const std::uint64_t high = times[i] + period_ns + uncertainty_ns;
    EXPECT_TRUE(std::ranges::any_of(
        presses, [&](std::uint64_t press) { return low <= press && press <= high; }))
        << "lit at " << times[i] << ", and no press from " << low << " to " << high;
  }
  const auto inside = std::ranges::count_if(presses, [&](std::uint64_t press) {
    return press > times.front() + 2 * period_ns && press + 5 * period_ns < times.back();
  });
  EXPECT_GE(shown_count, static_cast<std::size_t>(inside));
  EXPECT_GT(inside, 0) << "the button was not pressed";
}

std::string output_of(const std::vector<std::string>& command) {
  const auto end = test::run(command, kPatience);
  EXPECT_TRUE(end && end->exit_code == 0) << (end ? end->errors : command[0] + " did not end");
  return end ? end->output : "";
}

class Camera : public WithRegistry {
 protected:
  [[nodiscard]] test::Process start_camera(std::vector<std::string> options) const {
    options.insert(options.begin(), path_of("rtpm-camerad"));
    options.insert(options.end(),
                   {"--port", "0", "--registry", registry_->url, "--realtime", "off"});
    return test::Process(options);
  }
  /// Records the button and the camera for some presses.
  void record(std::vector<std::string> camera_options) {
    device_ = start_server("rtpm-deviced", {"--serve-events"});
    camera_options.insert(camera_options.end(), {"--medium-cam0-button", "lab/arm0"});
    camera_ = start_server("rtpm-camerad", std::move(camera_options));
    ASSERT_TRUE(device_ && camera_);
    const auto end = rtpm({"record", file_, "--media", "lab/cam0", "--for", "5s"});
    ASSERT_EQ(end.exit_code, 0) << end.errors;
  }
  /// The pictures of an exported file, as FFmpeg decodes them.
  [[nodiscard]] std::vector<camerad::Luma> decode() {
    const std::string raw = folder_.file("raw");
    static_cast<void>(output_of({"ffmpeg", "-v", "error", "-i", video_, "-map", "0:v", "-vsync",
                                 "passthrough", "-f", "rawvideo", "-pix_fmt", "gray", raw}));
    std::ifstream stream(raw, std::ios::binary);
    pixels_.assign(std::istreambuf_iterator<char>(stream), {});
    constexpr std::size_t kSize = std::size_t{TestSource::kWidth} * TestSource::kHeight;
    std::vector<camerad::Luma> pictures;
    for (std::size_t at = 0; at + kSize <= pixels_.size(); at += kSize)
      pictures.push_back(
          {std::span(pixels_).subspan(at, kSize), TestSource::kWidth, TestSource::kHeight});
    return pictures;
  }

  test::TemporaryFolder folder_;
  std::string file_ = folder_.file("run.mcap");
  std::string video_ = folder_.file("run.mkv");
  std::vector<std::uint8_t> pixels_{};
  std::optional<Daemon> device_{};
  std::optional<Daemon> camera_{};
};

TEST_F(Camera, ARecordingShowsTheButtonAtTheTimeOfItsEvent) {
  if (!test::run({"ffprobe", "-version"}, kPatience))
    GTEST_SKIP() << "needs ffprobe and ffmpeg: install the Debian package ffmpeg";
  record({});
  auto reader = recording::FileReader::open(file_);
  ASSERT_TRUE(reader) << reader.error().text();
  const Recorded recorded = read(**reader);
  ASSERT_GT(recorded.pictures.size(), 20);
  EXPECT_EQ(recorded.uncertainty_ns, kPictureNs);
  expect_shown(recorded.sounds, recorded.tones, recorded.presses, kSoundNs, kSoundNs);

  const auto exported = run_program("rtpm", {"bag", "export", file_, video_, "--video"});
  EXPECT_EQ(exported.exit_code, 0) << exported.errors;
  expect_text(exported.output,
              {std::to_string(recorded.pictures.size()) + " pictures of lab/cam0"});
  expect_one_sentence(
      run_program("rtpm", {"bag", "export", file_, video_, "--video", "--medium", "lab/cam9"}), 1,
      {"no camera lab/cam9", "it has lab/cam0"});
  std::istringstream times(
      output_of({"ffprobe", "-v", "error", "-select_streams", "v", "-show_entries",
                 "packet=pts_time", "-of", "csv=p=0", video_}));
  std::size_t count = 0;
  for (std::string line; std::getline(times, line); ++count) {
    ASSERT_LT(count, recorded.pictures.size());
    const double since_s =
        static_cast<double>(recorded.pictures[count] - recorded.pictures.front()) * 1e-9;
    EXPECT_NEAR(std::stod(line), since_s, 2e-6) << "picture " << count;
  }
  EXPECT_EQ(count, recorded.pictures.size());

  std::vector<bool> lamps;
  const std::vector<camerad::Luma> pictures = decode();
  ASSERT_EQ(pictures.size(), recorded.pictures.size());
  for (std::size_t i = 0; i < pictures.size(); ++i) {
    const auto painted = camerad::read_number(pictures[i]);
    ASSERT_TRUE(painted) << "picture " << i;
    // Both on the clock of the recording, from the first picture on.
    const auto painted_ns = *painted - *camerad::read_number(pictures.front());
    EXPECT_NEAR(static_cast<double>(painted_ns),
                static_cast<double>(recorded.pictures[i] - recorded.pictures.front()), 1e3);
    lamps.push_back(camerad::read_lamp(pictures[i]));
  }
  expect_shown(recorded.pictures, lamps, recorded.presses, kPictureNs, recorded.uncertainty_ns);
}

TEST_F(Camera, AWrongPipelineIsNamedAndTheProgramEnds) {
  auto end = start_camera({"--medium-cam0-pipeline", "rtpmnosuchsrc ! appsink name=video"})
                 .wait(kPatience);
  ASSERT_TRUE(end);
  expect_one_sentence(*end, 1, {"lab/cam0", "rtpmnosuchsrc", "Remedy"});
}

TEST_F(Camera, APipelineThatEndsIsToldAndStartedAgain) {
  camera_ = start_server("rtpm-camerad",
                         {"--media", "mic0", "--medium-mic0-pipeline",
                          "audiotestsrc is-live=true num-buffers=5 ! appsink name=sound"});
  ASSERT_TRUE(camera_);
  EXPECT_TRUE(camera_->process.wait_for_errors("lab/mic0: its pipeline has ended", kPatience));
  EXPECT_TRUE(test::await([&] {
    const std::string state = rtpm({"call", "lab/mic0", "state"}).output;
    return state.find("\"restart_count\": 0") == state.npos;
  }));
}

TEST_F(Camera, TheElementsOfThePlugInServeAndReadAMedium) {
  gst_init(nullptr, nullptr);
  GError* problem = nullptr;
  GstPlugin* const plugin = gst_plugin_load_file(RTPM_GSTREAMER_PLUGIN, &problem);
  ASSERT_NE(plugin, nullptr) << problem->message;
  const auto made = [&](const std::string& text) {
    GError* error = nullptr;
    GstElement* const pipeline = gst_parse_launch(text.c_str(), &error);
    EXPECT_EQ(error, nullptr) << error->message;
    return camerad::Owned<GstElement>(GST_ELEMENT(gst_object_ref_sink(pipeline)));
  };
  const std::string where = " medium=lab/made registry=" + registry_->url;
  const auto server = made(
      "videotestsrc is-live=true ! video/x-raw,width=160,height=120,framerate=30/1 ! jpegenc ! "
      "rtpmsink" +
      where);
  static_cast<void>(gst_element_set_state(server.get(), GST_STATE_PLAYING));
  ASSERT_TRUE(test::await(
      [&] { return rtpm({"list"}).output.find("lab/made") != std::string::npos; }, kPatience));
  const auto reader = made("rtpmsrc name=in" + where + " latency=70 ! appsink name=out sync=false");
  const MonotonicTime begin = rt::now();
  static_cast<void>(gst_element_set_state(reader.get(), GST_STATE_PLAYING));
  const camerad::Owned<GstElement> out(gst_bin_get_by_name(GST_BIN(reader.get()), "out"));
  for (int i = 0; i < 3; ++i) {
    const camerad::Owned<GstSample> sample(
        gst_app_sink_try_pull_sample(GST_APP_SINK(out.get()), 20 * GST_SECOND));
    ASSERT_NE(sample, nullptr) << "picture " << i;
    const GstStructure* const caps = gst_caps_get_structure(gst_sample_get_caps(sample.get()), 0);
    EXPECT_STREQ(gst_structure_get_name(caps), "image/jpeg");
    int width = 0;
    EXPECT_TRUE(gst_structure_get_int(caps, "width", &width));
    EXPECT_EQ(width, 160);
    const auto captured = time_from_ns(
        static_cast<std::int64_t>(gst_element_get_base_time(reader.get()) +
                                  GST_BUFFER_PTS(gst_sample_get_buffer(sample.get()))));
    EXPECT_GE(captured, begin);
    EXPECT_LE(captured, rt::now());
  }
  const camerad::Owned<GstQuery> query(gst_query_new_latency());
  // A sink that does not wait for times answers for itself.
  const camerad::Owned<GstElement> in(gst_bin_get_by_name(GST_BIN(reader.get()), "in"));
  ASSERT_TRUE(gst_element_query(in.get(), query.get()));
  gboolean is_live = FALSE;
  GstClockTime low = 0;
  gst_query_parse_latency(query.get(), &is_live, &low, nullptr);
  EXPECT_TRUE(is_live);
  EXPECT_EQ(low, 70 * GST_MSECOND);
  for (GstElement* const pipeline : {reader.get(), server.get()})
    static_cast<void>(gst_element_set_state(pipeline, GST_STATE_NULL));
}

}  // namespace
}  // namespace rtpm::system_test
