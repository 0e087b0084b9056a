#include "rtpm/program/duration.hpp"

#include <gtest/gtest.h>

#include <string_view>

namespace rtpm::program {
namespace {

using namespace std::chrono_literals;

struct Reading {
  std::string_view text;
  std::optional<Duration> duration;
};

class ParseDuration : public testing::TestWithParam<Reading> {};

TEST_P(ParseDuration, ReadsNumberAndUnit) {
  EXPECT_EQ(parse_duration(GetParam().text), GetParam().duration) << GetParam().text;
}

INSTANTIATE_TEST_SUITE_P(Texts, ParseDuration,
                         testing::Values(Reading{"800us", 800us}, Reading{"2s", 2s},
                                         Reading{"1.5ms", 1500us}, Reading{"2 s", 2s},
                                         Reading{"3min", 3min}, Reading{"1h", 1h},
                                         Reading{"7ns", 7ns}, Reading{"0", 0ns}, Reading{"0s", 0ns},
                                         Reading{"9223372036854775807ns", Duration::max()},
                                         Reading{"0.0000000004s", 0ns}));

INSTANTIATE_TEST_SUITE_P(
    Nonsense, ParseDuration,
    testing::Values(Reading{"", {}}, Reading{"5", {}}, Reading{"s", {}}, Reading{"-1s", {}},
                    Reading{"+1s", {}}, Reading{"1 parsec", {}}, Reading{"1.2.3s", {}},
                    Reading{".s", {}}, Reading{"1e3s", {}}, Reading{"infs", {}},
                    Reading{"nans", {}}, Reading{"9223372036854775808ns", {}},
                    Reading{"2562048h", {}}, Reading{"9999999999.5s", {}}, Reading{"1s ", {}}));

TEST(DurationText, TakesTheLargestUnitThatIsExact) {
  EXPECT_EQ(duration_text(0ns), "0s");
  EXPECT_EQ(duration_text(800us), "800us");
  EXPECT_EQ(duration_text(2s), "2s");
  EXPECT_EQ(duration_text(90s), "90s");
  EXPECT_EQ(duration_text(120s), "2min");
  EXPECT_EQ(duration_text(1500us), "1500us");
}

TEST(DurationText, ReadsBackUnchanged) {
  for (const Duration duration : {Duration{1}, Duration{999'999'999'999'999'999}, Duration::max(),
                                  Duration{3600s}, Duration{1ms}}) {
    EXPECT_EQ(parse_duration(duration_text(duration)), duration);
  }
}

}  // namespace
}  // namespace rtpm::program
