#include "rtpm/base/printable.hpp"

#include <gtest/gtest.h>

#include <random>
#include <string>

namespace rtpm {
namespace {

using namespace std::string_literals;

TEST(Printable, KeepsOrdinaryText) {
  for (const char* const text : {"", "lab/arm0", "Händler \\ 手 😀", "a\\x1b"})
    EXPECT_EQ(printable(text), text);
}

TEST(Printable, EscapesControlsOfATerminal) {
  EXPECT_EQ(printable("\x1b[2J\x1b]0;owned\x07"), "\\x1b[2J\\x1b]0;owned\\x07");
  EXPECT_EQ(printable("\x7f\0x\b"s), "\\x7f\\x00x\\x08");
  // CSI as a single C1 character, in UTF-8 and as a bare byte.
  EXPECT_EQ(printable("\xc2\x9b"
                      "31m"),
            "\\u{9b}31m");
  EXPECT_EQ(printable("\x9b"
                      "31m"),
            "\\x9b31m");
}

TEST(Printable, IsOneLine) {
  EXPECT_EQ(printable("a\nrtpm-eventd: all is well\r\tb"), "a\\nrtpm-eventd: all is well\\r\\tb");
  EXPECT_EQ(printable("a\u2028b\u0085c"), "a\\u{2028}b\\u{85}c");
}

TEST(Printable, EscapesInvisibleAndBidirectionalCharacters) {
  EXPECT_EQ(printable("ad\u200bmin\u202egnp.exe\u2066\ufeff"),
            "ad\\u{200b}min\\u{202e}gnp.exe\\u{2066}\\u{feff}");
  EXPECT_EQ(printable("\U000e0041"), "\\u{e0041}");
}

TEST(Printable, EscapesInvalidUtf8) {
  EXPECT_EQ(printable("\xff\xfe"), "\\xff\\xfe");
  EXPECT_EQ(printable("\xc0\xaf"), "\\xc0\\xaf") << "longer than needed";
  EXPECT_EQ(printable("\xed\xa0\x80"), "\\xed\\xa0\\x80") << "half of a pair";
  EXPECT_EQ(printable("\xf4\x90\x80\x80"), "\\xf4\\x90\\x80\\x80") << "beyond Unicode";
  EXPECT_EQ(printable("\xe2\x82"), "\\xe2\\x82") << "cut off";
  EXPECT_EQ(printable("\xe2(\xa1"), "\\xe2(\\xa1");
}

TEST(Printable, CutsBetweenCharacters) {
  EXPECT_EQ(printable("abcdef", 3), "abc…");
  EXPECT_EQ(printable("abc", 3), "abc");
  EXPECT_EQ(printable("ab\u00e9", 3), "ab…");
  EXPECT_EQ(printable(std::string(10'000, 'x')).size(), kShownSizeMax + 3);
}

TEST(Printable, KeepsLinesOnRequest) {
  EXPECT_EQ(printable_lines("table A {\n\tx: int; // \x1b[2J\r\n}"),
            "table A {\n\tx: int; // \\x1b[2J\\r\n}");
}

TEST(Printable, IsIdempotentAndEscapesEveryControl) {
  std::mt19937 random(1);
  for (int round = 0; round < 2000; ++round) {
    std::string text(random() % 40, ' ');
    for (char& each : text)
      each = static_cast<char>(random());
    const std::string once = printable(text);
    EXPECT_EQ(printable(once, kShownWhole), once);
    for (const char each : once)
      EXPECT_FALSE(static_cast<unsigned char>(each) < 0x20 || each == 0x7f);
  }
}

}  // namespace
}  // namespace rtpm
