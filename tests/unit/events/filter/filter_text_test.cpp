#include "rtpm/events/filter_text.hpp"

#include <gtest/gtest.h>

#include <fstream>

#include "rtpm/test/text.hpp"
#include "table.hpp"

// The text of filters: registry/events/FILTERS.md.
namespace rtpm::events::test {
namespace {

using namespace std::chrono_literals;

constexpr EventDescriptor kPoseType{kPose, "lab.Pose", kPoseSchema, kPoseFields};
constexpr EventDescriptor kGazeType{kGaze, "lab.Gaze", 2, {}};
constexpr EventDescriptor kButtonType{kButton, "lab.Button", 3, {}};
constexpr std::array kTypes{&kPoseType, &kGazeType, &kButtonType};

Filter parsed(const std::string& text) {
  const auto filter = parse_filter(text, kTypes);
  EXPECT_TRUE(filter) << filter.error().what << "\n" << filter.error().picture(text);
  return filter.value_or(Filter{});
}

/// Compares field by field, because Filter has no comparison.
void expect_equal(const Filter& a, const Filter& b, const std::string& where) {
  EXPECT_EQ(a.kind, b.kind) << where;
  EXPECT_EQ(a.type, b.type) << where;
  EXPECT_EQ(a.type_mask, b.type_mask) << where;
  EXPECT_EQ(a.source, b.source) << where;
  EXPECT_EQ(a.source_mask, b.source_mask) << where;
  EXPECT_EQ(a.field, b.field) << where;
  EXPECT_EQ(a.comparison, b.comparison) << where;
  EXPECT_EQ(a.operand.as_real(), b.operand.as_real()) << where;
  EXPECT_EQ(a.span, b.span) << where;
  EXPECT_EQ(a.tag, b.tag) << where;
  EXPECT_EQ(a.matches, b.matches) << where;
  ASSERT_EQ(a.children.size(), b.children.size()) << where;
  for (std::size_t i = 0; i < a.children.size(); ++i)
    expect_equal(a.children[i], b.children[i], where + "[" + std::to_string(i) + "]");
}

struct Sentence {
  std::string text;
  Filter filter;
};

std::vector<Sentence> sentences() {
  const Filter pose = of_type(kPose);
  const Filter gaze = of_type(kGaze);
  const Filter button = of_type(kButton);
  const Filter strong = where(kPose, "force", Comparison::kGreater, Scalar::of(2));
  return {
      {"all", everything()},
      {"type(lab.Pose)", pose},
      {"type(5)", pose},
      {"source(3)", masked(0, 0, 3, kWholeNumber)},
      {"source(0x10/0xf0)", masked(0, 0, 0x10, 0xf0)},
      {"type(0x100/0xff00)", masked(0x100, 0xff00, 0, 0)},
      {"type(lab.Pose) and source(3)", of_type(kPose, 3)},
      {"type(lab.Pose, lab.Gaze)", listed({{.type = kPose, .type_mask = kWholeNumber},
                                           {.type = kGaze, .type_mask = kWholeNumber}})},
      {"listed(lab.Pose:1, *:2:3)",
       listed({{kPose, kWholeNumber, 1, kWholeNumber, 0}, {0, 0, 2, kWholeNumber, 3}})},
      {"type(lab.Pose) or type(lab.Gaze)", any_of({pose, gaze})},
      {"not type(lab.Pose)", none_of(pose)},
      {"not not source(1)", none_of(none_of(masked(0, 0, 1, kWholeNumber)))},
      {"type(lab.Pose) and force > 2", all_of({pose, strong})},
      {"force > 2 and type(lab.Pose)", all_of({strong, pose})},
      {"lab.Pose:force > 2", strong},
      {"5:force > 2", strong},
      {"type(lab.Pose) and source(3) and not force > 2",
       all_of({of_type(kPose, 3), none_of(strong)})},
      {"type(lab.Pose) and x <= -1.5e-3",
       all_of({pose, where(kPose, "x", Comparison::kLessOrEqual, Scalar::of(-1.5e-3))})},
      {"type(lab.Pose) and is_held == true",
       all_of({pose, where(kPose, "is_held", Comparison::kEqual, Scalar::of(true))})},
      {"type(lab.Pose) and keys & 0x81",
       all_of({pose, where(kPose, "keys", Comparison::kHasAnyBit, Scalar::of(0x81))})},
      {"type(lab.Pose) and (step < 1 or step > 5)",
       all_of({pose, any_of({where(kPose, "step", Comparison::kLess, Scalar::of(1)),
                             where(kPose, "step", Comparison::kGreater, Scalar::of(5))})})},
      // "and" binds stronger than "or", and both stronger than "within".
      {"source(1) or source(2) and type(lab.Pose)",
       any_of({masked(0, 0, 1, kWholeNumber), all_of({masked(0, 0, 2, kWholeNumber), pose})})},
      {"type(lab.Pose) within 5ms of type(lab.Gaze)", correlate({pose, gaze}, 5ms)},
      {"type(lab.Pose) and source(3) and force > 2 within 5ms of type(lab.Gaze)",
       correlate({all_of({of_type(kPose, 3), strong}), gaze}, 5ms)},
      {"type(lab.Pose) with type(lab.Gaze), type(lab.Button)", correlate({pose, gaze, button})},
      {"type(lab.Button) or (type(lab.Pose) within 5ms of type(lab.Gaze))",
       any_of({button, correlate({pose, gaze}, 5ms)})},
      {"once(2s)", once(2s)},
      {"every(16ms, 7)", every(16ms, 7)},
      {"type(lab.Pose) or silence(100ms)", any_of({pose, silence(100ms)})},
  };
}

TEST(FilterText, ReadsEachSentence) {
  for (const Sentence& sentence : sentences())
    expect_equal(parsed(sentence.text), sentence.filter, sentence.text);
}

struct Mistake {
  std::string text;
  std::size_t offset;
  std::string words;
};

TEST(FilterText, PointsAtEachMistake) {
  const Mistake mistakes[] = {
      {"", 0, "expected a condition, such as type(…), source(…) or a field, not the end"},
      {"type(lab.Poes)", 5, "no type is named 'lab.Poes' (did you mean 'lab.Pose'?)"},
      {"type(lab.Pose", 13, "expected ')', not the end"},
      {"type(lab.Pose) and", 18, "expected a condition"},
      {"type(lab.Pose) source(1)", 15, "expected 'and', 'or', 'within', 'with' or the end"},
      {"type(lab.Pose) and forse > 2", 19, "lab.Pose has no field 'forse' (did you mean 'force'?)"},
      {"force > 2", 0, "no type says what 'force' is; write 'type(NAME) and force …'"},
      {"type(lab.Pose) or force > 2", 18, "no type says what 'force' is"},
      {"lab.Pose:force = 2", 15, "write '=='"},
      {"lab.Pose:force ? 2", 15, "expected ==, !=, <, <=, >, >= or & behind 'force', not '?'"},
      {"lab.Pose:force > much", 17, "expected a number, true or false, not 'much'"},
      {"lab.Pose:keys == 256", 17, "256 is none of the values of uint8"},
      {"7:force > 2", 2, "lab.Gaze has no field 'force'"},
      {"9:force > 2", 2, "the fields of type 9 are not known"},
      {"source(-1)", 7, "expected a source's number, not '-1'"},
      {"source(4294967296)", 7, "'4294967296' exceeds 4294967295"},
      {"sorce(1)", 0, "there is no condition 'sorce' (did you mean 'source'?)"},
      {"every(5)", 6, "expected a time, such as 5ms, not '5'"},
      {"every(1us)", 6, "the time must be 100us to 24h"},
      {"type(1) within 5 of type(2)", 15, "expected a time, such as 5ms, not '5'"},
      {"type(1) within 5ms type(2)", 19, "expected 'of', not 'type'"},
      {"type(1) && type(2)", 8, "write 'and'"},
      {"!type(1)", 0, "write 'not'"},
      {"type(1) and \x1b[2J", 12, "not '\\x1b'"},
      {"listed(lab.Pose)", 15, "expected ':', not ')'"},
  };
  for (const Mistake& mistake : mistakes) {
    const auto filter = parse_filter(mistake.text, kTypes);
    ASSERT_FALSE(filter) << mistake.text;
    EXPECT_EQ(filter.error().offset, mistake.offset) << mistake.text << ": " << filter.error().what;
    rtpm::test::expect_text(filter.error().what, {mistake.words});
  }
}

TEST(FilterText, KeepsTheLimitsOfFilters) {
  std::string many = "source(0)";
  for (std::size_t i = 1; i < kFilterNodeCountMax; ++i)
    many += " or source(" + std::to_string(i) + ")";
  rtpm::test::expect_text(parse_filter(many, kTypes).error().what, {"at most 64 parts"});
  std::string deep = "all";
  for (std::size_t i = 0; i < kFilterDepthMax; ++i)
    deep = "not " + deep;
  rtpm::test::expect_text(parse_filter(deep, kTypes).error().what, {"at most 16 deep"});
  for (const std::size_t size : {100'000u, 4000u})
    EXPECT_FALSE(parse_filter(std::string(size, '('), kTypes));
}

TEST(FilterText, EachExampleOfThePageIsAFilter) {
  std::ifstream page(RTPM_FILTERS_PAGE);
  int count = 0;
  bool is_output = false;
  for (std::string line; std::getline(page, line);) {
    if (line == "```") is_output = !is_output;
    if (is_output || !line.starts_with("    ") || line.find("::=") != std::string::npos) continue;
    const auto filter = parse_filter(line.substr(4), kTypes);
    EXPECT_TRUE(filter) << line << "\n" << filter.error().what;
    ++count;
  }
  EXPECT_GT(count, 12);
}

}  // namespace
}  // namespace rtpm::events::test
