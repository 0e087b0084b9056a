#include "rtpm/device_io/words.hpp"

#include <gtest/gtest.h>

namespace rtpm::test {
namespace {

const device_io::KnownWords kKnown{.names = {"port", "speed"}, .names_to_the_end = {"file"}};

TEST(Words, AreNamesWithValues) {
  const auto words = device_io::read_words("serial", "  port=/dev/ttyACM0   speed=9600 ", kKnown);
  ASSERT_TRUE(words);
  EXPECT_EQ(*words, (device_io::Words{{"port", "/dev/ttyACM0"}, {"speed", "9600"}}));
  EXPECT_TRUE(device_io::read_words("serial", "", kKnown)->empty());
}

TEST(Words, MayGoOnToTheEnd) {
  const auto words = device_io::read_words("player", "speed=2 file=/a b=c.mkv", kKnown);
  ASSERT_TRUE(words);
  EXPECT_EQ(*words, (device_io::Words{{"file", "/a b=c.mkv"}, {"speed", "2"}}));
}

TEST(Words, AreRefusedInWordsThatNameTheKnownOnes) {
  const auto text = [](std::string_view words) {
    const auto read = device_io::read_words("serial", words, kKnown);
    return read ? "taken" : read.error().text();
  };
  EXPECT_EQ(
      text("sped=9600"),
      "the driver serial does not know the word 'sped'. Remedy: give words like 'name=value'; "
      "the names are port, speed, file.");
  EXPECT_NE(text("port").find("needs a value for 'port'"), std::string::npos);
  EXPECT_NE(text("port=").find("needs a value for 'port'"), std::string::npos);
  EXPECT_NE(text("file=").find("needs a value for 'file'"), std::string::npos);
  EXPECT_NE(text("speed=1 speed=2").find("'speed' twice"), std::string::npos);
  EXPECT_NE(text("=1").find("does not know the word ''"), std::string::npos);
}

TEST(Words, HaveValuesAndNumbers) {
  const auto words = device_io::read_words("serial", "speed=9600", kKnown);
  ASSERT_TRUE(words);
  EXPECT_EQ(device_io::value_of(*words, "speed"), "9600");
  EXPECT_EQ(device_io::value_of(*words, "port"), "");
  EXPECT_EQ(device_io::to_number<int>("9600"), 9600);
  EXPECT_EQ(device_io::to_number<double>("-0.5"), -0.5);
  for (const char* text : {"", "9600 ", " 1", "1x", "0x10", "+1", "99999999999"})
    EXPECT_EQ(device_io::to_number<int>(text), std::nullopt) << text;
}

}  // namespace
}  // namespace rtpm::test
