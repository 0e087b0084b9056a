#include "rtpm/configuration/value_text.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <vector>

#include "samples.hpp"

namespace rtpm::gvd {
namespace {

TEST(ValueText, IsReadBackExactly) {
  const std::vector<driver::ParameterSpec> specs = test::sample_specs();
  const std::vector<driver::ParameterValue> values{false,
                                                   std::int64_t{-7},
                                                   0.1 + 0.2,
                                                   std::string("a b"),
                                                   std::string("fast"),
                                                   std::vector<double>{1e-9, -0.5, 1.0 / 3}};
  for (std::size_t i = 0; i < values.size(); ++i) {
    const auto parsed = parse_value(specs[i], to_text(values[i]));
    ASSERT_TRUE(parsed) << specs[i].name;
    EXPECT_EQ(*parsed, values[i]) << specs[i].name;
  }
}

TEST(ValueText, IsRefusedForAnotherType) {
  const std::vector<driver::ParameterSpec> specs = test::sample_specs();
  const std::vector<std::vector<std::string>> wrong{
      {"1", "yes", ""}, {"1.5", "x", "", "99999999999999999999"}, {"1,5", "", "1 N"}};
  for (std::size_t i = 0; i < wrong.size(); ++i) {
    for (const std::string& text : wrong[i]) {
      const auto parsed = parse_value(specs[i], text);
      ASSERT_FALSE(parsed) << specs[i].name << " " << text;
      EXPECT_EQ(parsed.error().outcome, ConfigurationOutcome::kWrongType);
      EXPECT_EQ(parsed.error().parameter, specs[i].name);
      EXPECT_NE(parsed.error().words.text().find("Remedy: give"), std::string::npos);
    }
  }
  for (const char* text : {"", "1,", ",1", "1,,2", "1;2;3"}) {
    EXPECT_FALSE(parse_value(specs[5], text)) << text;
  }
}

TEST(ValueText, ShowsRanges) {
  std::vector<driver::ParameterSpec> specs = test::sample_specs();
  EXPECT_EQ(range_text(specs[0]), "");
  EXPECT_EQ(range_text(specs[2]), "0 to 9");
  EXPECT_EQ(range_text(specs[4]), "slow | fast");
  EXPECT_EQ(range_text(specs[5]), "3 of -0.1 to 0.1");
  specs[2].high = std::numeric_limits<double>::infinity();
  EXPECT_EQ(range_text(specs[2]), "at least 0");
}

}  // namespace
}  // namespace rtpm::gvd
