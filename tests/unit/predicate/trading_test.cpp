#include <gtest/gtest.h>

#include <cstdint>
#include <iterator>
#include <limits>
#include <optional>
#include <random>
#include <string>

#include "offer.hpp"
#include "rtpm/predicate/predicate.hpp"
#include "rtpm/rt/memory.hpp"

// The Trading Service's constraint language, as far as predicates support it.
namespace rtpm::predicate {
namespace {

const Offer& printer() {
  static const Offer kOffer({
      {"ppm", std::int64_t{12}},
      {"cost", 2.5, "euro"},
      {"model", std::string("Falcon 2000")},
      {"is_free", true},
      {"big", std::numeric_limits<std::int64_t>::max()},
      {"keys", std::int64_t{0x81}},
      {"paper", List{Type::kText, {std::string("A4"), std::string("A3")}}},
      {"trays", List{Type::kInteger, {std::int64_t{1}, std::int64_t{2}}}},
      {"empty", List{Type::kText, {}}},
  });
  return kOffer;
}

struct Case {
  const char* text;
  bool accepts;
};

class Trading : public testing::TestWithParam<Case> {};

TEST_P(Trading, AcceptsAnOffer) {
  const auto predicate = Predicate::parse(GetParam().text, printer().types());
  ASSERT_TRUE(predicate) << GetParam().text << ": " << predicate.error().what << " at "
                         << predicate.error().offset;
  EXPECT_EQ(predicate->accepts(printer()), GetParam().accepts) << GetParam().text;
}

INSTANTIATE_TEST_SUITE_P(
    Constraints, Trading,
    testing::Values(
        // The empty predicate fits all offers; constants.
        Case{"", true}, Case{"TRUE", true}, Case{"FALSE", false}, Case{"true", true},
        // Comparison: numbers, texts, and truths for equality.
        Case{"ppm == 12", true}, Case{"ppm != 12", false}, Case{"ppm < 12.5", true},
        Case{"ppm <= 12", true}, Case{"ppm > 12", false}, Case{"ppm >= 11.9e0", true},
        Case{"cost < 3", true}, Case{"cost == 2.5", true}, Case{"model == 'Falcon 2000'", true},
        Case{"model == \"Falcon 2000\"", true}, Case{"model < 'Gecko'", true},
        Case{"is_free == TRUE", true}, Case{"is_free != false", true}, Case{"is_free", true},
        Case{"ppm == 0xc", true}, Case{"keys & 0x80", true}, Case{"keys & 0x7e", false},
        // Comparison is exact, although a double cannot represent the integer.
        Case{"big == 9223372036854775807", true}, Case{"big < 9223372036854775808.0", true},
        Case{"big == 9223372036854775808.0", false},
        // Arithmetic, with the usual precedence.
        Case{"ppm + 2 * 3 == 18", true}, Case{"(ppm + 2) * 3 == 42", true},
        Case{"ppm - 2 - 3 == 7", true}, Case{"ppm / 8 == 1.5", true}, Case{"-ppm == -12", true},
        Case{"cost * 4 <= ppm - 2", true}, Case{"ppm-2 == 10", true}, Case{"big + 1 > big", true},
        // An integer's result is exact where it is an integer, else a double.
        Case{"big * 1 == 9223372036854775807", true}, Case{"big - 1 - big == -1", true},
        Case{"-big - 1 == -9223372036854775807 - 1", true}, Case{"-big * -1 == big", true},
        Case{"3037000499 * -3037000499 == -9223372030926249001", true},
        Case{"3037000500 * -3037000500 == -9223372037000250000.0", true},
        Case{"-3037000500 * -3037000500 == 9223372037000250000.0", true},
        Case{"(-big - 1) * -1 > big", true}, Case{"-1 * (-big - 1) > big", true},
        Case{"-big - 2 == -9223372036854775808.0", true}, Case{"big - -1 > big", true},
        // A sequence contains a value.
        Case{"'A4' in paper", true}, Case{"'A5' in paper", false}, Case{"2 in trays", true},
        Case{"2.0 in trays", true}, Case{"'A4' in empty", false},
        Case{"model in ('Gecko', 'Falcon 2000')", true}, Case{"ppm in (-12, 1.5)", false},
        // The right text contains the left one.
        Case{"'con' ~ model", true}, Case{"'Con' ~ model", false}, Case{"'' ~ model", true},
        // A property exists or not.
        Case{"exist ppm", true}, Case{"exists dpi", false}, Case{"not exists dpi", true},
        // Not binds before and, and before or.
        Case{"not ppm == 13 and cost < 3", true}, Case{"is_free or ppm / 0 > 1 and false", true},
        Case{"false and false or true", true}, Case{"false and (false or true)", false},
        Case{"not not is_free", true}));

INSTANTIATE_TEST_SUITE_P(WithoutTheProperty, Trading,
                         testing::Values(
                             // An offer without the property does not match.
                             Case{"dpi > 3", false}, Case{"dpi == dpi", false},
                             Case{"not dpi > 3", false}, Case{"not (dpi > 3 and is_free)", false},
                             Case{"dpi + 1 == 2", false}, Case{"dpi in (1, 2)", false},
                             Case{"3 in dpi", false}, Case{"'x' ~ dpi", false}, Case{"dpi", false},
                             Case{"not dpi", false},
                             // Another condition may decide.
                             Case{"dpi > 3 or is_free", true}, Case{"is_free or dpi > 3", true},
                             Case{"not (dpi > 3 and not is_free)", true},
                             Case{"not exists dpi or dpi > 3", true},
                             Case{"exists dpi and dpi > 3", false},
                             // An undefined value does not match, either.
                             Case{"ppm / 0 > 1", false}, Case{"not ppm / 0 > 1", false},
                             Case{"1e308 * 10 * ppm > 1", false}));

struct BadCase {
  const char* text;
  std::size_t offset;
  const char* what;
};

class BadPredicate : public testing::TestWithParam<BadCase> {};

TEST_P(BadPredicate, IsRefusedAtItsPosition) {
  const BadCase& row = GetParam();
  const auto predicate = Predicate::parse(row.text, printer().types());
  ASSERT_FALSE(predicate) << row.text;
  EXPECT_EQ(predicate.error().offset, row.offset) << row.text << ": " << predicate.error().what;
  EXPECT_NE(predicate.error().what.find(row.what), std::string::npos)
      << row.text << ": " << predicate.error().what;
}

INSTANTIATE_TEST_SUITE_P(
    Syntax, BadPredicate,
    testing::Values(BadCase{"ppm >", 5, "not the end"}, BadCase{"ppm = 3", 4, "write '=='"},
                    BadCase{"ppm == 3 cost", 9, "expected an operator"},
                    BadCase{"(ppm == 3", 9, "expected ')'"}, BadCase{"! is_free", 0, "'not'"},
                    BadCase{"is_free && is_free", 8, "write 'and'"},
                    BadCase{"is_free || is_free", 8, "write 'or'"},
                    BadCase{"model == 'Falc", 9, "closing quote"},
                    BadCase{"ppm == 3kg", 7, "no number"}, BadCase{"ppm == 1 == 1", 9, "operator"},
                    BadCase{"exists 3", 7, "expected a property"},
                    BadCase{"ppm == 9223372036854775808", 7, "exceeds an integer"},
                    BadCase{"ppm in (1, 'a')", 11, "of one type"},
                    BadCase{"ppm in (-'a')", 8, "only numbers"},
                    BadCase{"ppm == \x01", 7, "'\\x01'"}));

INSTANTIATE_TEST_SUITE_P(
    Types, BadPredicate,
    testing::Values(BadCase{"ppm == 'a'", 7, "of text, and is compared with integer"},
                    BadCase{"cost > 1 and model > 3", 21, "is compared with text"},
                    BadCase{"model + 1 == 3", 0, "'+' takes numbers"},
                    BadCase{"not ppm", 4, "'not' takes bool"},
                    BadCase{"is_free and ppm", 12, "'and' takes bool"},
                    BadCase{"is_free < true", 0, "== and != only"},
                    BadCase{"paper == 'A4'", 0, "write 'ITEM in LIST'"},
                    BadCase{"'A4' in model", 8, "'in' takes a list"},
                    BadCase{"3 in paper", 0, "items of text"},
                    BadCase{"3 ~ model", 0, "'~' takes text"}, BadCase{"cost & 1", 0, "no bits"},
                    BadCase{"ppm + 1", 0, "not of bool"},
                    BadCase{"-model == 1", 1, "takes numbers"},
                    // This includes unknown properties.
                    BadCase{"dpi + 'a' == 1", 6, "'+' takes numbers"}));

TEST(Predicate, LimitsSizePartsAndDepth) {
  EXPECT_FALSE(Predicate::parse(std::string(kPredicateSizeMax + 1, ' ')));
  std::string many = "ppm";
  for (std::size_t i = 0; i < kPredicateNodeCountMax; ++i)
    many += "+1";
  const auto too_many = Predicate::parse(many + " > 1");
  ASSERT_FALSE(too_many);
  EXPECT_NE(too_many.error().what.find("at most 256 parts"), std::string::npos);
  for (const char* const opening : {"(", "not ", "-"}) {
    std::string deep;
    for (int i = 0; i < 1000; ++i)
      deep += opening;
    const auto refused = Predicate::parse(deep + "ppm");
    ASSERT_FALSE(refused);
    EXPECT_NE(refused.error().what.find("nested too deeply"), std::string::npos) << opening;
  }
}

// Any text is a predicate, or an error with a position in it.
TEST(Predicate, SurvivesAnyText) {
  constexpr const char* kPieces[] = {
      "ppm", "cost", "model", "paper",  "dpi", "(",     ")",    ",", "and",    "or", "not",
      "in",  "~",    "==",    "<",      "&",   "+",     "-",    "*", "/",      "1",  "2.5",
      "'a'", "'",    "true",  "exists", "0x",  "1e999", "\xff", "=", "is_free"};
  std::mt19937 random(1);
  int accepted_count = 0;
  for (int round = 0; round < 50'000; ++round) {
    std::string text;
    for (std::size_t size = random() % 9; size > 0; --size)
      text += std::string(kPieces[random() % std::size(kPieces)]) + " ";
    const auto predicate = Predicate::parse(text, printer().types());
    if (predicate) {
      accepted_count += predicate->accepts(printer()) ? 1 : 0;
    } else {
      ASSERT_LE(predicate.error().offset, text.size()) << text;
      ASSERT_FALSE(predicate.error().what.empty()) << text;
    }
  }
  EXPECT_GT(accepted_count, 0);
}

TEST(Predicate, MarksAnErrorByACaret) {
  const std::string_view text = "cost > 1 and dpi = 3\x1b";
  const auto refused = Predicate::parse(text);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().picture(text), "cost > 1 and dpi = 3\\x1b\n                 ^");
}

TEST(Predicate, AllocatesNothingWhenEvaluated) {
  const auto predicate = Predicate::parse("'con' ~ model and ppm * 2 > 3 and 'A3' in paper");
  ASSERT_TRUE(predicate);
  const Offer& offer = printer();
  bool accepts = false;
  {
    const rt::NoAllocationScope scope;
    accepts = predicate->accepts(offer);
  }
  EXPECT_TRUE(accepts);
}

}  // namespace
}  // namespace rtpm::predicate
