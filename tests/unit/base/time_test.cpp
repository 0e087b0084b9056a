#include "rtpm/base/time.hpp"

#include <gtest/gtest.h>

namespace rtpm {
namespace {

using namespace std::chrono_literals;

TEST(DeadlineAfter, AddsWithoutOverflowForEveryTimeAndSpan) {
  EXPECT_EQ(deadline_after(2ns, time_from_ns(3)), time_from_ns(5));
  EXPECT_EQ(deadline_after(1ns, kNever), kNever);
  EXPECT_EQ(deadline_after(Duration::max(), time_from_ns(1)), kNever);
  EXPECT_EQ(deadline_after(Duration::max(), time_from_ns(0)), kNever);
  EXPECT_EQ(deadline_after(-2ns, time_from_ns(5)), time_from_ns(3));
  // A client may send any deadline, one before the clock's origin, too.
  EXPECT_EQ(deadline_after(Duration::max(), MonotonicTime::min()), time_from_ns(-1));
}

}  // namespace
}  // namespace rtpm
