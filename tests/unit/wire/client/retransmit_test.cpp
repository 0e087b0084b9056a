#include "rtpm/wire/retransmit.hpp"

#include <gtest/gtest.h>

#include <algorithm>

#include "frames.hpp"

namespace rtpm::wire {
namespace {

using namespace test;
using namespace std::chrono_literals;

/// Lets the timer see calls answered after `round_trip` each, none of them repeated.
void measure(RetransmitTimer& timer, Duration round_trip, int call_count) {
  for (int i = 0; i < call_count; ++i) {
    timer.begin(at(0s));
    timer.end(at(round_trip));
  }
}

/// The timer's wait before it repeats a call for the first time.
Duration first_wait(RetransmitTimer& timer) {
  timer.begin(at(0s));
  return timer.due() - at(0s);
}

// RFC 6298, 2.2: the first measurement R makes the mean R and the deviation R/2, so R + 4·R/2 = 3R.
TEST(RetransmitTimer, WaitsThreeRoundTripsAfterTheFirst) {
  RoundTrip path;
  RetransmitTimer timer(path);
  measure(timer, 2ms, 1);
  EXPECT_EQ(path.smoothed(), Duration{2ms});
  EXPECT_EQ(first_wait(timer), Duration{6ms});
}

// RFC 6298, 2.3: the deviation moves by a quarter of the error's excess, then the mean by an eighth
// of the error. From R = 2 ms: error 8 ms; deviation 1 + (8 − 1)/4 = 2.75; mean 2 + 8/8 = 3.
TEST(RetransmitTimer, SmoothsAsInRfc6298) {
  RoundTrip path;
  RetransmitTimer timer(path);
  measure(timer, 2ms, 1);
  measure(timer, 10ms, 1);
  EXPECT_EQ(path.smoothed(), Duration{3ms});
  EXPECT_EQ(first_wait(timer), Duration{3ms + 4 * 2750us});
}

TEST(RetransmitTimer, DoublesForEachCopyUpToTheMaximum) {
  RoundTrip path;
  RetransmitTimer timer(path);
  timer.begin(at(0s));
  MonotonicTime sent = at(0s);
  Duration wait = kRetransmitIntervalFirst;
  for (int i = 1; i < 20; ++i) {
    ASSERT_EQ(timer.due() - sent, wait) << "before copy " << i;
    sent = timer.due();
    timer.repeat(sent);
    EXPECT_EQ(timer.repeat_count(), i);
    wait = std::min<Duration>(2 * wait, kRetransmitIntervalMax);
  }
  EXPECT_EQ(wait, kRetransmitIntervalMax);
}

TEST(RetransmitTimer, IsBoundedOnBothSides) {
  RoundTrip path;
  RetransmitTimer timer(path);
  measure(timer, 5us, 100);
  EXPECT_EQ(first_wait(timer), kRetransmitIntervalMin);
  timer.end(at(5us));
  measure(timer, 60s, 100);
  EXPECT_EQ(first_wait(timer), kRetransmitIntervalMax);
}

// Karn: it is unknown which copy was answered.
TEST(RetransmitTimer, DoesNotMeasureARepeatedCall) {
  RoundTrip path;
  RetransmitTimer timer(path);
  measure(timer, 2ms, 1);
  timer.begin(at(0s));
  timer.repeat(at(6ms));
  timer.end(at(500ms));
  EXPECT_EQ(path.smoothed(), Duration{2ms});
}

// Karn's second half, RFC 6298, 5.5 to 5.7: a doubled wait holds for the next call, until one is
// answered unrepeated. Without it, a round trip that grew beyond the wait would never be measured
// again, and every call would be repeated for ever.
TEST(RetransmitTimer, MeasuresARoundTripThatGrew) {
  constexpr Duration kNewRoundTrip = 20ms;
  RoundTrip path;
  RetransmitTimer timer(path);
  measure(timer, 100us, 100);
  int repeated_count = 0;
  for (int call = 0; call < 100; ++call) {
    timer.begin(at(0s));
    while (timer.due() < at(kNewRoundTrip))
      timer.repeat(timer.due());
    repeated_count += timer.repeat_count() > 0 ? 1 : 0;
    timer.end(at(kNewRoundTrip));
  }
  EXPECT_LT(repeated_count, 10);
  EXPECT_NEAR(static_cast<double>(path.smoothed().count()), 20e6, 1e6);
}

/// A call that is repeated until its answer comes, `took` after its first copy.
void repeat_until(RetransmitTimer& timer, Duration took) {
  timer.begin(at(0s));
  while (timer.due() < at(took))
    timer.repeat(timer.due());
  timer.end(at(took));
}

TEST(RetransmitTimer, ResetsTheDoubledWaitAfterAPromptAnswer) {
  RoundTrip path;
  RetransmitTimer timer(path);
  measure(timer, 2ms, 100);
  const Duration usual = first_wait(timer);
  timer.end(at(2ms));
  repeat_until(timer, 30ms);
  repeat_until(timer, 30ms);
  EXPECT_GT(first_wait(timer), usual);
  timer.end(at(2ms));
  EXPECT_LE(first_wait(timer), usual);
}

// On a link with occasional losses, calls with a short deadline need early repetitions: after each
// loss the next call starts with a fresh wait.
TEST(RetransmitTimer, DoesNotWaitLongerAfterOneLoss) {
  RoundTrip path;
  RetransmitTimer timer(path);
  measure(timer, 100us, 100);
  const Duration usual = first_wait(timer);
  timer.end(at(100us));
  repeat_until(timer, 8ms);
  EXPECT_EQ(first_wait(timer), usual);
}

// The last call's total time bounds its round trip, whichever copy was answered.
TEST(RetransmitTimer, DoesNotWaitMuchLongerThanTheLastCallTook) {
  RoundTrip path;
  RetransmitTimer timer(path);
  measure(timer, 100us, 100);
  repeat_until(timer, 520us);
  repeat_until(timer, 520us);
  EXPECT_EQ(first_wait(timer), Duration{650us});
}

TEST(RetransmitTimer, AcceptsAClockThatStandsStill) {
  RoundTrip path;
  RetransmitTimer timer(path);
  measure(timer, 0ns, 10);
  EXPECT_GT(path.smoothed(), Duration{0}) << "0 would mean: never measured";
  EXPECT_EQ(first_wait(timer), kRetransmitIntervalMin);
}

}  // namespace
}  // namespace rtpm::wire
