#include "web/places.hpp"

#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <vector>

#include "web/frame_budget.hpp"

namespace rtpm::console {
namespace {

using namespace std::chrono_literals;

class Places : public testing::Test {
 protected:
  void enter(const std::string& peer, const std::string& name) {
    places_.push_back(std::make_unique<Place>(table_, peer, [this, name] { displaced_ += name; }));
  }

  PlaceTable table_{3};
  std::vector<std::unique_ptr<Place>> places_{};
  std::string displaced_{};
};

TEST_F(Places, ReplaceTheOldestBeyondTheCapacity) {
  for (const char* name : {"a", "b", "c"})
    enter("one", name);
  EXPECT_EQ(displaced_, "");
  EXPECT_TRUE(table_.is_full());
  enter("one", "d");
  EXPECT_EQ(displaced_, "a");
  EXPECT_EQ(table_.size(), 3u);
  enter("one", "e");
  EXPECT_EQ(displaced_, "ab");
}

TEST_F(Places, AreTakenFromThePeerWithTheMost) {
  enter("decent", "D");
  for (int i = 0; i < 100; ++i)
    enter("flood", "f");
  EXPECT_EQ(displaced_, std::string(98, 'f'));
  enter("other", "O");
  EXPECT_EQ(displaced_, std::string(99, 'f'));
}

TEST_F(Places, AreFreedByTheirHolder) {
  for (const char* name : {"a", "b", "c"})
    enter("one", name);
  places_.erase(places_.begin());
  EXPECT_EQ(table_.size(), 2u);
  enter("one", "d");
  EXPECT_EQ(displaced_, "");
}

TEST(FrameBudgets, AllowBurstsAndLimitTheRate) {
  FrameBudget budget;
  MonotonicTime now{1s};
  Duration wait{0};
  int frame_count = 0;
  while (wait == 0s) {
    wait = budget.take(100, now);
    ++frame_count;
  }
  // Half a second at 256 KiB/s; each frame counts one kibibyte more than its size.
  EXPECT_NEAR(frame_count, 117, 3);
  // A client that waits as told does not exceed the rate.
  std::size_t byte_count = 0;
  for (const MonotonicTime end = now + 10s; now < end; now += wait) {
    wait = budget.take(64 * 1024, now);
    byte_count += 64 * 1024;
  }
  EXPECT_LE(static_cast<double>(byte_count), 10.5 * FrameBudget::kBytesPerSecond);
  // After a pause it may burst again.
  EXPECT_EQ(budget.take(100, now + 10s), 0s);
}

}  // namespace
}  // namespace rtpm::console
