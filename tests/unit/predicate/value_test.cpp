#include "rtpm/predicate/value.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <string>

namespace rtpm::predicate {
namespace {

TEST(Value, IsReadFromItsText) {
  EXPECT_EQ(parse_value("true"), Value(true));
  EXPECT_EQ(parse_value("-3"), Value(std::int64_t{-3}));
  EXPECT_EQ(parse_value("2.5"), Value(2.5));
  EXPECT_EQ(parse_value("arm 7"), Value(std::string("arm 7")));
  EXPECT_EQ(parse_value("'3'"), Value(std::string("3")));
  EXPECT_EQ(parse_value(R"('it\'s')"), Value(std::string("it's")));
  EXPECT_EQ(parse_value("('x', y)"),
            Value(List{Type::kText, {std::string("x"), std::string("y")}}));
  EXPECT_EQ(parse_value("(1, 2.5)"), Value(List{Type::kReal, {1.0, 2.5}}));
  EXPECT_EQ(parse_value("()"), Value(List{Type::kText, {}}));
  for (const char* const bad :
       {"(1, x)", "(1", "(1,)", "(1 2)", "(1) 2", "'open", "'a' b", "9223372036854775808"})
    EXPECT_FALSE(parse_value(bad)) << bad;
}

TEST(Value, RoundTripsThroughItsText) {
  const Value values[] = {true,
                          std::int64_t{-7},
                          0.1,
                          3.0,
                          1e300,
                          std::string("a 'quoted' \\ text"),
                          std::string("17"),
                          List{Type::kBool, {true, false}},
                          List{Type::kReal, {1.0, 0.25}},
                          List{Type::kText, {std::string("x"), std::string("3")}}};
  for (const Value& value : values) {
    EXPECT_EQ(parse_value(to_text(value)), value) << to_text(value);
    EXPECT_EQ(type_named(to_string(type_of(value))), type_of(value));
  }
  EXPECT_FALSE(type_named("number"));
}

}  // namespace
}  // namespace rtpm::predicate
