#include "rtpm/device_mpv/settings.hpp"

#include <gtest/gtest.h>

namespace rtpm::device_mpv {
namespace {

TEST(MpvSettings, ReadAFileWithSpaces) {
  const auto settings = read_settings("  headless=yes file=/films/a film.mkv");
  ASSERT_TRUE(settings);
  EXPECT_EQ(settings->file, "/films/a film.mkv");
  EXPECT_TRUE(settings->is_headless);
}

TEST(MpvSettings, ReadASocket) {
  const auto settings = read_settings("socket=/run/mpv");
  ASSERT_TRUE(settings);
  EXPECT_EQ(settings->socket, "/run/mpv");
}

TEST(MpvSettings, AreRefusedWithTheReason) {
  for (const char* words : {"", "clip.mkv", "headless=yes", "file=", "headless=perhaps file=a",
                            "volume=3 file=a", "headless=yes socket=/run/mpv"}) {
    const auto settings = read_settings(words);
    ASSERT_FALSE(settings) << words;
    EXPECT_NE(settings.error().text().find("file=CLIP"), std::string::npos) << words;
  }
}

TEST(MpvTransport, SaysWhatIsMissing) {
  EXPECT_NE(open_mpv({.file = "/no/such/clip"})().error().text().find("No such file"),
            std::string::npos);
  EXPECT_NE(open_mpv({.socket = "/no/such/socket"})().error().text().find("--input-ipc-server"),
            std::string::npos);
  EXPECT_FALSE(open_mpv({.socket = std::string(200, 'x')})());
}

}  // namespace
}  // namespace rtpm::device_mpv
