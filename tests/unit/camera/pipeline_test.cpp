#include "pipeline.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <string>

#include "configuration.hpp"
#include "parameters.hpp"
#include "pipeline_error.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/test/text.hpp"

// Pipelines of GStreamer: the errors of bad ones, and what good ones give.
namespace rtpm::camerad {
namespace {

using namespace std::chrono_literals;

class PipelineTest : public testing::Test {
 protected:
  static void SetUpTestSuite() { gst_init(nullptr, nullptr); }
  [[nodiscard]] std::string error_of(const std::string& text) {
    const auto made = Pipeline::create(text, {}, server_);
    EXPECT_FALSE(made) << text;
    return made ? "" : made.error().text();
  }
  /// Runs a pipeline to its end, and gives the reason.
  [[nodiscard]] std::string end_of(const std::string& text) {
    const auto made = Pipeline::create(text, {}, server_);
    EXPECT_TRUE(made) << made.error().text();
    if (!made) return "";
    (*made)->play();
    const auto problem = (*made)->wait_for_end(rt::now() + 20s);
    return problem ? problem->text() : "";
  }

  media::MediumServer server_{media::MediumDescriptionT{}};
};

TEST_F(PipelineTest, AnErrorNamesElementCauseAndRemedy) {
  test::expect_text(error_of("rtpmnosuchsrc ! appsink name=video"),
                    {"rtpmnosuchsrc", "GStreamer here has none", "Remedy", "apt-cache"});
  test::expect_text(error_of("videotestsrc ! ! appsink name=video"), {"text is wrong", "Remedy"});
  test::expect_text(error_of("videotestsrc ! fakesink"), {"no appsink", "appsink name=video"});
  // Raw pictures are too large to be sent, and are not linked.
  test::expect_text(error_of("videotestsrc ! capsfilter caps=audio/x-raw ! appsink name=video"),
                    {"could not link videotestsrc", "Remedy"});
}

TEST_F(PipelineTest, NamesThePackageOfAMissingElement) {
  GError error{.domain = GST_PARSE_ERROR,
               .code = GST_PARSE_ERROR_NO_SUCH_ELEMENT,
               .message = const_cast<char*>("no element \"x264enc\"")};
  const std::string text = parse_error(error).text();
  test::expect_text(text,
                    {"x264enc", "Remedy: install the Debian package gstreamer1.0-plugins-ugly"});
  EXPECT_EQ(package_of("avenc_mpeg4"), "gstreamer1.0-libav");
}

TEST_F(PipelineTest, TellsASourceThatEndsFailsOrIsNotLive) {
  test::expect_text(end_of("audiotestsrc is-live=true num-buffers=2 ! appsink name=sound"),
                    {"has ended", "Remedy"});
  test::expect_text(
      end_of("filesrc location=/no/such/file ! jpegdec ! jpegenc ! appsink name=video"),
      {"filesrc0", "/no/such/file", "Remedy"});
  test::expect_text(end_of("videotestsrc ! jpegenc ! appsink name=video"),
                    {"from the future", "is-live=true"});
}

TEST_F(PipelineTest, LearnsTheFormats) {
  const auto made = Pipeline::create(
      "videotestsrc is-live=true ! video/x-raw,width=160,height=120,framerate=50/1 ! jpegenc ! "
      "appsink name=video audiotestsrc is-live=true ! audio/x-raw,rate=16000,channels=2 ! appsink "
      "name=sound",
      1ms, server_);
  ASSERT_TRUE(made) << made.error().text();
  (*made)->play();
  while ((*made)->piece_count() < 20)
    ASSERT_FALSE((*made)->wait_for_end(rt::now() + 1ms));
  flatbuffers::FlatBufferBuilder builder;
  std::array<std::byte, 4096> memory{};
  rpc::ReplyBuilder<media::MediumDescription> reply(memory);
  ASSERT_TRUE(server_.describe(reply, {}));
  ASSERT_EQ(reply.complete().status, wire::Status::kOk);
  const auto& about = *flatbuffers::GetRoot<media::MediumDescription>(memory.data());
  EXPECT_EQ(about.video()->codec(), media::Codec::Jpeg);
  EXPECT_EQ(about.video()->width_px(), 160);
  EXPECT_EQ(about.video()->rate_hz(), 50);
  EXPECT_EQ(about.sound()->codec(), media::Codec::PcmS16);
  EXPECT_EQ(about.sound()->sample_rate_hz(), 16000);
  EXPECT_EQ(about.sound()->channel_count(), 2);
}

TEST_F(PipelineTest, OffersTheNumbersOfSourcesAndEncodersAsParameters) {
  const std::string text = "videotestsrc is-live=true ! jpegenc name=Encoder ! appsink name=video";
  const auto first = Pipeline::create(text, {}, server_);
  ASSERT_TRUE(first);
  Parameters parameters(**first, {});
  const auto specs = parameters.parameters();
  ASSERT_EQ(specs.size(), 1);
  EXPECT_EQ(specs.front().name, "encoder.quality");
  parameters.use(first->get());
  std::vector<driver::ParameterSetting> settings{{"encoder.quality", std::int64_t{33}}};
  ASSERT_TRUE(parameters.apply(settings, false));
  const auto quality_of = [](const Pipeline& pipeline) {
    int quality = 0;
    g_object_get(pipeline.element("Encoder").get(), "quality", &quality, nullptr);
    return quality;
  };
  EXPECT_EQ(quality_of(**first), 33);
  const auto second = Pipeline::create(text, {}, server_);
  ASSERT_TRUE(second);
  parameters.use(second->get());
  EXPECT_EQ(quality_of(**second), 33) << "the value is lost when the pipeline is made again";
}

}  // namespace
}  // namespace rtpm::camerad
