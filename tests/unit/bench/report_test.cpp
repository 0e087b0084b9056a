#include "figures/report.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <string>

namespace rtpm::bench {
namespace {

TEST(JsonObject, KeepsTheOrderAndTheTypesOfItsMembers) {
  JsonObject inner;
  inner.add("cpu_count", 2);
  JsonObject json;
  json.add("case", "call");
  json.add("n", std::int64_t{100'000});
  json.add("p50_us", 6.5707);
  json.add("virtualised", true);
  json.add("marks", std::vector<std::string>{"a", "b"});
  json.add("environment", inner);
  EXPECT_EQ(json.text(), R"({"case": "call", "n": 100000, "p50_us": 6.571, "virtualised": true, )"
                         R"("marks": ["a", "b"], "environment": {"cpu_count": 2}})");
}

TEST(JsonObject, EscapesWhatJsonDoesNotTakeAsItIs) {
  JsonObject json;
  json.add("text", "a\"b\\c\n");
  EXPECT_EQ(json.text(), R"({"text": "a\"b\\c\u000a"})");
}

TEST(JsonObject, HasNoWordForANumberThatIsNone) {
  JsonObject json;
  json.add("ratio", std::numeric_limits<double>::quiet_NaN());
  EXPECT_EQ(json.text(), R"({"ratio": null})");
}

TEST(JsonObject, TellsEachRoundOfADistribution) {
  Samples samples(2, 20);
  for (int round = 0; round < 2; ++round) {
    samples.begin_round(round);
    for (int i = 1; i <= 20; ++i)
      samples.add(std::chrono::microseconds{i + round});
  }
  JsonObject json;
  add_distribution(json, "floor_", samples);
  EXPECT_NE(json.text().find(R"("floor_p50_us": 10.500)"), std::string::npos) << json.text();
  EXPECT_NE(json.text().find(R"("floor_rounds_p50_us": [10.000, 11.000])"), std::string::npos);
  EXPECT_NE(json.text().find(R"("floor_rounds_p99_us": [21.000])"), std::string::npos)
      << "of both rounds together, as there are few samples";
}

TEST(AddRounds, NotesWhichWereLeftOutAndMarksTooMany) {
  Samples samples(6, 1);
  samples.begin_round(0);
  samples.note_disturbed(true);
  Result few;
  add_rounds(few, samples, samples);
  EXPECT_EQ(few.json.text(), R"({"rounds": 6, "rounds_left_out": 1})");
  ASSERT_EQ(few.notes.size(), 1u);
  EXPECT_EQ(few.notes[0],
            "the machine stood still in 1 of 6 rounds, which are left out, but for p99.99 and max");
  EXPECT_TRUE(few.marks.empty());
  for (int round = 1; round < 5; ++round) {
    samples.begin_round(round);
    samples.note_disturbed(true);
  }
  Result many;
  add_rounds(many, samples, samples);
  EXPECT_EQ(many.json.text(), R"({"rounds": 6, "rounds_left_out": 0})");
  EXPECT_TRUE(many.notes.empty());
  ASSERT_EQ(many.marks.size(), 1u);
  EXPECT_EQ(many.marks[0], "the machine stood still in 5 of 6 rounds, too many to be left out");
}

TEST(Report, PrintsOneJsonObjectALineWithMarksAndEnvironment) {
  JsonObject environment;
  environment.add("kernel", "6.1");
  Report report(Report::Form::kJsonLines, environment, "a machine");
  Result result{.title = "call", .marks = {"disturbed"}};
  result.json.add("case", "call");
  testing::internal::CaptureStdout();
  report.add(result);
  report.add(result);
  const std::string line =
      R"({"case": "call", "marks": ["disturbed"], "environment": {"kernel": "6.1"}})"
      "\n";
  EXPECT_EQ(testing::internal::GetCapturedStdout(), line + line);
  EXPECT_EQ(report.result_count(), 2);
}

TEST(Report, PrintsTheMachineOnceAndATablePerResult) {
  Report report(Report::Form::kTable, {}, "a machine");
  Result result{.title = "call, udp", .notes = {"a note"}, .marks = {"disturbed"}};
  result.rows.push_back({"RTPM", {.p50 = 6.571, .p90 = 12.34, .p99 = 123.4}});
  testing::internal::CaptureStdout();
  report.add(result);
  report.add(result);
  const std::string text = testing::internal::GetCapturedStdout();
  EXPECT_EQ(text.find("a machine"), 0u);
  EXPECT_EQ(text.find("a machine", 1), std::string::npos);
  EXPECT_NE(text.find("RTPM                        6.57      12.3       123"), std::string::npos);
  EXPECT_NE(text.find("  a note\n  ! disturbed\n"), std::string::npos);
}

}  // namespace
}  // namespace rtpm::bench
