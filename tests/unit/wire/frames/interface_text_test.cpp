#include "rtpm/wire/interface_text.hpp"

#include <gtest/gtest.h>

#include <random>
#include <string>

// The explanations of why two versions do not fit; the spec's vectors tell which versions fit.
namespace rtpm::wire {
namespace {

const std::string kText =
    "service lab.Arm\n"
    "method 7 get idempotent\nrequest empty rtpm.Empty\nreply table lab.Reply\n"
    "enum lab.Mode uint8 {\n  Free = 0\n}\n"
    "table lab.Reply {\n  0 mode: uint8 lab.Mode = 0\n  1 next: object lab.Reply optional\n}\n"
    "table rtpm.Empty {\n}\n";

std::string changed(const std::string& before, const std::string& after) {
  std::string text = kText;
  text.replace(text.find(before), before.size(), after);
  return text;
}

TEST(FindObstacle, NamesTheMethodAndBothSides) {
  EXPECT_FALSE(find_obstacle(kText, kText));
  EXPECT_EQ(find_obstacle(kText, changed("method 7", "method 8")),
            "method 'get' (id 7) is missing there");
  EXPECT_EQ(find_obstacle(kText, changed("get", "ask")),
            "method 'get' (id 7): it is `ask` there and `get` here");
  EXPECT_EQ(find_obstacle(kText, changed(" idempotent", "")),
            "method 'get' (id 7): it is idempotent here, so that it would be repeated, and not "
            "there");
  EXPECT_EQ(find_obstacle(kText, changed("idempotent", "idempotent stream")),
            "method 'get' (id 7): it is `stream` there and `a call with a reply` here");
  EXPECT_EQ(find_obstacle(kText, changed("reply table lab.Reply", "reply empty rtpm.Empty")),
            "method 'get' (id 7): it gives `empty rtpm.Empty` there and `table lab.Reply` here");
  EXPECT_EQ(find_obstacle(kText, changed("0 mode", "0 kind")),
            "method 'get' (id 7): field 0 of `table lab.Reply` is `0 kind: uint8 lab.Mode = 0` "
            "there and `0 mode: uint8 lab.Mode = 0` here");
  EXPECT_EQ(
      find_obstacle(changed("}\ntable rtpm", "  2 new: string required\n}\ntable rtpm"), kText),
      "method 'get' (id 7): field `2 new: string required` of `table lab.Reply` is missing "
      "there");
  EXPECT_EQ(find_obstacle(kText, changed("Free = 0", "Idle = 0")),
            "method 'get' (id 7): a value of `enum lab.Mode uint8` is `Idle = 0` there and "
            "`Free = 0` here");
  EXPECT_EQ(find_obstacle(kText, "hello"), "the text of its interface cannot be read");
}

// hp-6.3-2: any bytes from a server yield an answer.
TEST(FindObstacle, AcceptsAnyBytes) {
  std::mt19937 random(7);
  const auto below = [&](std::size_t count) {
    return std::uniform_int_distribution<std::size_t>(0, count - 1)(random);
  };
  int understood = 0;
  for (int round = 0; round < 20'000; ++round) {
    std::string text = kText;
    for (std::size_t edits = 1 + below(3); edits > 0 && !text.empty(); --edits) {
      const std::size_t at = below(text.size());
      switch (below(4)) {
        case 0:
          text[at] = static_cast<char>(below(256));
          break;
        case 1:
          text.erase(at, 1 + below(20));
          break;
        case 2:
          text.insert(at, text.substr(below(text.size()), below(30)));
          break;
        default:
          text.resize(at + 1);
          break;
      }
    }
    understood += find_obstacle(kText, text) ? 0 : 1;
    (void)find_obstacle(text, kText);
  }
  EXPECT_LT(understood, 2'000) << "few changes are harmless";
}

}  // namespace
}  // namespace rtpm::wire
