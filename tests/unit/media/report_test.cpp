#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "clip.hpp"
#include "follow_meter.hpp"
#include "line.hpp"

namespace rtpm::media {
namespace {

using std::chrono::milliseconds;

TEST(FollowMeter, MeasuresFromCommandToPicture) {
  FollowMeter meter;
  const MonotonicTime begin{std::chrono::seconds{1000}};
  meter.show(4, 0.04, begin);
  meter.command(5, begin);
  meter.command(5, begin + milliseconds{10});
  meter.show(4, 0.04, begin + milliseconds{10});
  meter.command(5.04, begin + milliseconds{12});
  meter.command(5.08, begin + milliseconds{14});
  meter.show(5, 0.04, begin + milliseconds{20});
  meter.show(5.08, 0.04, begin + milliseconds{30});
  EXPECT_EQ(meter.target_count(), 3u);
  EXPECT_EQ(meter.followed().count(), 2u) << "one was skipped";
  EXPECT_EQ(meter.followed().max(), milliseconds{20});
  EXPECT_EQ(meter.followed().min(), milliseconds{16});
  EXPECT_NEAR(meter.forwards_s(), 1.08, 1e-9);
  EXPECT_EQ(meter.backwards_s(), 0);
}

TEST(FollowMeter, DropsTargetsThatAreNeverShown) {
  FollowMeter meter;
  const MonotonicTime begin{std::chrono::seconds{1000}};
  for (int i = 0; i < 1000; ++i)
    meter.command(i, begin);
  meter.show(3, 0.04, begin + milliseconds{10});
  EXPECT_EQ(meter.followed().count(), 0u);
  meter.show(999, 0.04, begin + milliseconds{10});
  EXPECT_EQ(meter.followed().count(), 1u);
}

TEST(MediaLine, ShowsThePlayer) {
  EXPECT_EQ(
      line_text(Mode::kScrub, {.position_s = 10, .duration_s = 20, .frame_s = 0.04, .rate = 0}, 0),
      "scrub [============|...........]   10.00 of 20.00 s   paused  dial    +0.0°");
  EXPECT_EQ(
      line_text(Mode::kSpeed, {.position_s = 0, .duration_s = 0, .frame_s = 0.04, .rate = -1.5}, 1),
      "speed [|.......................]    0.00 of 0.00 s  -1.50 x  dial   +57.3°");
}

TEST(MediaClip, HasItsFrames) {
  const std::string path = testing::TempDir() + "rtpm_media_clip.y4m";
  const ClipConfig config{.width = 16, .height = 8, .frames_per_s = 10, .duration_s = 2};
  ASSERT_TRUE(write_clip(path, config));
  std::ifstream file(path, std::ios::binary);
  std::string header;
  std::getline(file, header);
  EXPECT_EQ(header, "YUV4MPEG2 W16 H8 F10:1 Ip A1:1 C420jpeg");
  const auto size = std::filesystem::file_size(path) - header.size() - 1;
  EXPECT_EQ(size, 20u * (6 + 16 * 8 * 3 / 2));
  std::filesystem::remove(path);
  EXPECT_FALSE(write_clip("/no/such/folder/clip.y4m", config));
}

}  // namespace
}  // namespace rtpm::media
