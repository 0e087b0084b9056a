#include "rtpm/base/expected.hpp"

#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <type_traits>
#include <utility>

namespace rtpm {
namespace {

enum class Fault { kCold, kHot };

expected<int, Fault> half_of(int number) {
  if (number % 2 != 0) return unexpected{Fault::kHot};
  return number / 2;
}

/// Counts the live instances, so that a lost or doubled destruction shows.
class Counted {
 public:
  explicit Counted(int& live_count) : live_count_(&live_count) { ++*live_count_; }
  Counted(const Counted& other) : live_count_(other.live_count_) { ++*live_count_; }
  Counted(Counted&& other) noexcept : live_count_(other.live_count_) { ++*live_count_; }
  Counted& operator=(const Counted&) = delete;
  ~Counted() { --*live_count_; }

 private:
  int* live_count_;
};

TEST(Expected, HoldsEitherTheValueOrTheError) {
  const auto good = half_of(8);
  ASSERT_TRUE(good);
  EXPECT_TRUE(good.has_value());
  EXPECT_EQ(*good, 4);
  EXPECT_EQ(good.value_or(-1), 4);

  const auto bad = half_of(7);
  ASSERT_FALSE(bad);
  EXPECT_EQ(bad.error(), Fault::kHot);
  EXPECT_EQ(bad.value_or(-1), -1);
}

TEST(Expected, CarriesValuesThatOnlyMove) {
  expected<std::unique_ptr<int>, Fault> made = std::make_unique<int>(5);
  expected<std::unique_ptr<int>, Fault> moved = std::move(made);
  const std::unique_ptr<int> taken = std::move(moved).value();
  EXPECT_EQ(*taken, 5);
  static_assert(!std::is_copy_constructible_v<expected<std::unique_ptr<int>, Fault>>);
}

TEST(Expected, ChangesSidesByAssignment) {
  expected<std::string, int> result = std::string("long enough to be on the heap, surely");
  result = unexpected{3};
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error(), 3);
  result = std::string("back again");
  ASSERT_TRUE(result);
  EXPECT_EQ(*result, "back again");
}

TEST(Expected, DestroysExactlyWhatItHolds) {
  int live_count = 0;
  {
    expected<Counted, int> value = Counted(live_count);
    expected<Counted, int> copy = value;
    EXPECT_EQ(live_count, 2);
    copy = unexpected{1};
    EXPECT_EQ(live_count, 1);
    expected<int, Counted> error = unexpected{Counted(live_count)};
    EXPECT_EQ(live_count, 2);
    error = 9;
    EXPECT_EQ(live_count, 1);
  }
  EXPECT_EQ(live_count, 0);
}

TEST(Expected, CarriesAnErrorWithoutAValue) {
  expected<void, std::string> result;
  EXPECT_TRUE(result);
  result.value();
  result = unexpected{std::string("no memory")};
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error(), "no memory");
  const expected<void, std::string> copy = result;
  EXPECT_EQ(copy.error(), "no memory");
  result = expected<void, std::string>{};
  EXPECT_TRUE(result);
}

TEST(ExpectedDeathTest, AbortsWhenTheWrongSideIsRead) {
  auto good = half_of(2);
  auto bad = half_of(1);
  const expected<void, Fault> failed = unexpected{Fault::kCold};
  EXPECT_DEATH((void)*bad, "the value of a failed result was read");
  EXPECT_DEATH((void)good.error(), "the error of a successful result was read");
  EXPECT_DEATH(failed.value(), "the value of a failed result was read");
}

}  // namespace
}  // namespace rtpm
