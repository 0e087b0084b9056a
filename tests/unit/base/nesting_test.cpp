#include "rtpm/base/nesting.hpp"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <string>

namespace rtpm {
namespace {

std::string nested(std::size_t depth, const std::string& open, const std::string& close) {
  std::string text;
  for (std::size_t i = 0; i < depth; ++i)
    text += open;
  text += "1";
  for (std::size_t i = 0; i < depth; ++i)
    text += close;
  return text;
}

TEST(Nesting, CountsOpenArraysAndObjects) {
  EXPECT_TRUE(is_json_nested_within("1", 0));
  EXPECT_FALSE(is_json_nested_within("[]", 0));
  EXPECT_TRUE(is_json_nested_within(nested(64, "[", "]"), 64));
  EXPECT_FALSE(is_json_nested_within(nested(65, "[", "]"), 64));
  EXPECT_FALSE(is_json_nested_within(nested(65, R"({"a":)", "}"), 64));
  EXPECT_TRUE(is_json_nested_within("[[1],[2],[{}]]", 3));
  EXPECT_FALSE(is_json_nested_within("[[1],[2],[{}]]", 2));
}

TEST(Nesting, IgnoresBracketsInStrings) {
  EXPECT_TRUE(is_json_nested_within(R"(["[[[[{{{{"])", 1));
  EXPECT_TRUE(is_json_nested_within(R"(["\"[[[["])", 1));
  EXPECT_FALSE(is_json_nested_within(R"(["\\",[[]]])", 2));
  EXPECT_TRUE(is_json_nested_within("]]]]\"\\", 0));
}

TEST(BoundedJson, IsParsedUpToTheLimit) {
  using Json = nlohmann::json;
  EXPECT_EQ(parse_bounded_json<Json>(R"({"a":[1]})"), Json({{"a", {1}}}));
  EXPECT_TRUE(parse_bounded_json<Json>("{").is_discarded());
  EXPECT_TRUE(parse_bounded_json<Json>(nested(kNestingMax, "[", "]")).is_array());
  EXPECT_TRUE(parse_bounded_json<Json>(nested(kNestingMax + 1, "[", "]")).is_discarded());
  EXPECT_TRUE(parse_bounded_json<nlohmann::ordered_json>(nested(100'000, "[", "]")).is_discarded());
}

}  // namespace
}  // namespace rtpm
