#include "rtpm/driver/arguments.hpp"

#include <gtest/gtest.h>

namespace rtpm::test {
namespace {

const driver::KnownWords kKnown{.names = {"port", "speed"}, .names_to_the_end = {"file"}};

TEST(Words, AreNamesWithValues) {
  const auto words = driver::read_words("serial", "  port=/dev/ttyACM0   speed=9600 ", kKnown);
  ASSERT_TRUE(words);
  EXPECT_EQ(*words, (driver::Words{{"port", "/dev/ttyACM0"}, {"speed", "9600"}}));
  EXPECT_TRUE(driver::read_words("serial", "", kKnown)->empty());
}

TEST(Words, MayGoOnToTheEnd) {
  const auto words = driver::read_words("player", "speed=2 file=/a b=c.mkv", kKnown);
  ASSERT_TRUE(words);
  EXPECT_EQ(*words, (driver::Words{{"file", "/a b=c.mkv"}, {"speed", "2"}}));
}

TEST(Words, AreRefusedWithTheKnownOnes) {
  const auto text = [](std::string_view words) {
    const auto read = driver::read_words("serial", words, kKnown);
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
  const auto words = driver::read_words("serial", "speed=9600", kKnown);
  ASSERT_TRUE(words);
  EXPECT_EQ(driver::value_of(*words, "speed"), "9600");
  EXPECT_EQ(driver::value_of(*words, "port"), "");
  EXPECT_EQ(driver::to_number<int>("9600"), 9600);
  EXPECT_EQ(driver::to_number<double>("-0.5"), -0.5);
  for (const char* text : {"", "9600 ", " 1", "1x", "0x10", "+1", "99999999999"})
    EXPECT_EQ(driver::to_number<int>(text), std::nullopt) << text;
}

}  // namespace
}  // namespace rtpm::test
