#include "rtpm/base/log_limit.hpp"

#include <gtest/gtest.h>

namespace rtpm {
namespace {

using namespace std::chrono_literals;

class LogLimits : public testing::Test {
 protected:
  static MonotonicTime at(Duration since) { return MonotonicTime{} + 1000h + since; }
  int admitted(int count, Duration when) {
    int admitted_count = 0;
    for (int i = 0; i < count; ++i)
      admitted_count += limit_.admit(at(when)) ? 1 : 0;
    return admitted_count;
  }
  LogLimit limit_{{.burst = 5, .interval = 1s}};
};

TEST_F(LogLimits, AdmitABurstAndKeepOneLineForTheCount) {
  EXPECT_EQ(admitted(100, 0s), 4);
  EXPECT_EQ(limit_.take_suppressed(at(0s)), 96U);
  EXPECT_EQ(limit_.take_suppressed(at(0s)), 0U);
}

TEST_F(LogLimits, WriteOneLineEachIntervalOfAFlood) {
  EXPECT_EQ(admitted(100, 0s), 4);
  int line_count = 4;
  for (int i = 0; i < 10'000; ++i) {
    const Duration when = i * 1ms;
    line_count += limit_.take_suppressed(at(when)) > 0 ? 1 : 0;
    line_count += admitted(1, when);
  }
  EXPECT_LE(line_count, 4 + 1 + 10);
  EXPECT_GE(line_count, 4 + 1 + 9) << "and keep reporting";
}

TEST_F(LogLimits, CountEachSuppressedLine) {
  std::uint64_t reported = 0;
  std::uint64_t admitted_count = 0;
  for (int i = 0; i < 1000; ++i) {
    reported += limit_.take_suppressed(at(i * 10ms));
    admitted_count += static_cast<std::uint64_t>(admitted(1, i * 10ms));
  }
  EXPECT_EQ(reported + admitted_count + limit_.take_all_suppressed(), 1000U);
}

TEST_F(LogLimits, AllowABurstAgainAfterAPause) {
  EXPECT_EQ(admitted(100, 0s), 4);
  EXPECT_EQ(limit_.take_suppressed(at(1h)), 96U);
  EXPECT_EQ(admitted(100, 1h), 3);
  EXPECT_EQ(limit_.take_all_suppressed(), 97U);
  EXPECT_EQ(admitted(100, 2h), 4);
}

}  // namespace
}  // namespace rtpm
