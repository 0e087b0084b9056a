#include "figures/report.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "rtpm/test/text.hpp"

namespace rtpm::bench {
namespace {

TEST(AddDistribution, ListsEachRoundWithThreeDecimals) {
  Samples samples(2, 20);
  for (int round = 0; round < 2; ++round) {
    samples.begin_round(round);
    for (int i = 1; i <= 20; ++i)
      samples.add(std::chrono::microseconds{i + round});
  }
  Json result;
  add_distribution(result, "floor_", samples);
  EXPECT_EQ(result.at("floor_p50_us"), 10.5);
  EXPECT_EQ(result.at("floor_rounds_p50_us"), (Json{10.0, 11.0}));
  EXPECT_EQ(result.at("floor_rounds_p99_us"), Json::array({21.0}))
      << "of both rounds together, as there are few samples";
  EXPECT_EQ(rounded(6.57071), 6.571);
}

TEST(AddRounds, CountsExcludedRoundsAndMarksTooMany) {
  Samples samples(6, 1);
  samples.begin_round(0);
  samples.note_disturbed(true);
  Json few;
  add_rounds(few, samples, samples);
  EXPECT_EQ(few, (Json{{"rounds", 6}, {"rounds_left_out", 1}}));
  for (int round = 1; round < 5; ++round) {
    samples.begin_round(round);
    samples.note_disturbed(true);
  }
  Json many;
  add_rounds(many, samples, samples);
  EXPECT_EQ(many.at("rounds_left_out"), 0);
  EXPECT_EQ(many.at("marks").at(0),
            "the machine stood still in 5 of 6 rounds, too many to be left out");
}

TEST(Report, PrintsOneJsonObjectPerLine) {
  Report report(Report::Form::kJsonLines, {{"kernel", "6.1"}});
  testing::internal::CaptureStdout();
  report.add({{"case", "call"}, {"marks", {"disturbed"}}});
  report.add({{"case", "call"}, {"ratio", std::nan("")}});
  EXPECT_EQ(testing::internal::GetCapturedStdout(),
            R"({"case":"call","marks":["disturbed"],"environment":{"kernel":"6.1"}})"
            "\n"
            R"({"case":"call","ratio":null,"marks":[],"environment":{"kernel":"6.1"}})"
            "\n");
}

TEST(Report, PrintsTheMachineOnceAndATablePerResult) {
  Report report(Report::Form::kTable, {{"cpu", "a machine"}});
  testing::internal::CaptureStdout();
  for (int i = 0; i < 2; ++i) {
    report.add({{"case", "call"},
                {"transport", "udp"},
                {"floor_p50_us", 6.571},
                {"floor_p90_us", 12.34},
                {"floor_p99_us", 123.4},
                {"ratio_p50", 1.074},
                {"ratio_p50_low", 1.0},
                {"marks", {"disturbed"}}});
  }
  const std::string text = testing::internal::GetCapturedStdout();
  EXPECT_EQ(text.find("cpu: a machine"), 0u);
  EXPECT_EQ(text.find("a machine", 6), std::string::npos);
  test::expect_text(
      text, {"\ncall, transport udp\n", "floor                       6.57      12.3       123",
             "ratio                       1.07", "  ! disturbed\n"});
}

TEST(Report, IsIncompleteOnceSomethingFailed) {
  Report report(Report::Form::kTable, {});
  testing::internal::CaptureStderr();
  EXPECT_TRUE(report.is_complete());
  report.fail("call, udp", "no server");
  EXPECT_FALSE(report.is_complete());
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "rtpm-bench: call, udp: no server\n");
}

}  // namespace
}  // namespace rtpm::bench
