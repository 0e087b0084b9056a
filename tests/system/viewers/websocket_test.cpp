#include "laboratory.hpp"

// The console's WebSocket, as Foxglove and Lichtblick read it.
namespace rtpm::system_test {
namespace {

const std::string kTopics =
    "lab/arm0/sample,lab/gaze0/sample,lab/biometric0/sample,lab/knob0/sample,lab/arm0/pose,"
    "lab/gaze0/pose,lab/arm0/force,rtpm/tf";

class ViewedWebSocket : public ViewedLaboratory {
 protected:
  void expect_all(const std::string& lichtblick) {
    const std::string url = start_console();
    ASSERT_FALSE(url.empty());
    const Channels channels = view("live.mjs '" + url + "' " + kTopics + " " + lichtblick);
    expect_opened(channels);
    expect_drawn_as_sampled(channels, "/sample");
    expect_laid_out(channels, "/sample");
    EXPECT_EQ(channels.at("lab/arm0/pose")["schema"], "foxglove.PoseInFrame");
    EXPECT_EQ(channels.at("rtpm/tf")["schema"], "foxglove.FrameTransforms");
    EXPECT_EQ(channels.at("lab/arm0/force")["schema"], "foxglove.SceneUpdate");
    EXPECT_FALSE(channels.contains("lab/gaze0/force"));
    EXPECT_FALSE(channels.contains("lab/knob0/pose"));
  }
};

TEST_F(ViewedWebSocket, OpensInFlatbuffersReflection) {
  expect_all("");
}

TEST_F(ViewedWebSocket, OpensInLichtblick) {
  if (lichtblick_folder().empty()) GTEST_SKIP() << "RTPM_LICHTBLICK names no sources of Lichtblick";
  expect_all(lichtblick_folder());
}

}  // namespace
}  // namespace rtpm::system_test
