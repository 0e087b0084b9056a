#include "link/repetition_guard.hpp"

#include <gtest/gtest.h>

// Detection of duplicates (ev-5.3-2).
namespace rtpm::events {
namespace {

EventHeader event(std::uint64_t sequence, std::uint32_t tag = 7, EventType type = 5,
                  SourceId source = 0) {
  return {.type = type, .source = source, .sequence = sequence, .supplier_tag = tag};
}

TEST(RepetitionGuard, AdmitsEachSequenceOnce) {
  RepetitionGuard guard;
  for (std::uint64_t i = 10; i < 200; ++i) {
    EXPECT_TRUE(guard.admit(event(i))) << i;
    EXPECT_FALSE(guard.admit(event(i))) << i;
  }
}

TEST(RepetitionGuard, AdmitsReorderedEventsWithinItsSpan) {
  RepetitionGuard guard;
  EXPECT_TRUE(guard.admit(event(1000)));
  EXPECT_TRUE(guard.admit(event(1000 - RepetitionGuard::kSpan + 1)));
  EXPECT_FALSE(guard.admit(event(1000 - RepetitionGuard::kSpan + 1)));
  EXPECT_TRUE(guard.admit(event(998)));
  EXPECT_TRUE(guard.admit(event(999)));
  EXPECT_FALSE(guard.admit(event(998)));
  // The event is too old for the guard's memory.
  EXPECT_FALSE(guard.admit(event(1000 - RepetitionGuard::kSpan)));
}

TEST(RepetitionGuard, RejectsEventsBehindALeap) {
  RepetitionGuard guard;
  EXPECT_TRUE(guard.admit(event(1)));
  EXPECT_TRUE(guard.admit(event(1 + RepetitionGuard::kSpan)));
  EXPECT_TRUE(guard.admit(event(2)));
  EXPECT_FALSE(guard.admit(event(1)));
  EXPECT_TRUE(guard.admit(event(~std::uint64_t{0})));
  EXPECT_FALSE(guard.admit(event(3)));
}

TEST(RepetitionGuard, KeepsSuppliersTypesAndSourcesApart) {
  RepetitionGuard guard;
  EXPECT_TRUE(guard.admit(event(1)));
  EXPECT_TRUE(guard.admit(event(1, 8)));
  EXPECT_TRUE(guard.admit(event(1, 7, 6)));
  EXPECT_TRUE(guard.admit(event(1, 7, 5, 1)));
  EXPECT_FALSE(guard.admit(event(1, 7, 5, 1)));
}

TEST(RepetitionGuard, AdmitsEventsWithoutSequenceOrTag) {
  RepetitionGuard guard;
  EXPECT_TRUE(guard.admit(event(0)));
  EXPECT_TRUE(guard.admit(event(0)));
  EXPECT_TRUE(guard.admit(event(1, 0)));
  EXPECT_TRUE(guard.admit(event(1, 0)));
}

TEST(RepetitionGuard, EvictsTheLongestSilentSource) {
  RepetitionGuard guard(8);
  for (SourceId i = 0; i < 8; ++i)
    EXPECT_TRUE(guard.admit(event(1, 7, 5, i)));
  EXPECT_FALSE(guard.admit(event(1, 7, 5, 0)));  // Its source is no longer the longest silent.
  EXPECT_TRUE(guard.admit(event(1, 7, 5, 8)));
  EXPECT_FALSE(guard.admit(event(1, 7, 5, 0)));
  EXPECT_TRUE(guard.admit(event(1, 7, 5, 1)));
}

}  // namespace
}  // namespace rtpm::events
