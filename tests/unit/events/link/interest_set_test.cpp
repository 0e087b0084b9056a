#include "link/interest_set.hpp"

#include <gtest/gtest.h>

#include "rtpm/events/link.hpp"
#include "rtpm/test/text.hpp"
#include "table.hpp"

// The interest that a hub requests from another hub (ev-5.2).
namespace rtpm::events::test {
namespace {

using namespace std::chrono_literals;

Match of(EventType type, std::uint8_t hops = 0) {
  return {.type = type, .type_mask = kWholeNumber, .hops_min = hops};
}
Match of(EventType type, SourceId source, std::uint8_t hops) {
  return {type, kWholeNumber, source, kWholeNumber, hops};
}
using InterestSet = std::vector<Match>;

TEST(InterestSet, HasTheTypesAndSourcesOfEachKindOfNode) {
  const Filter pose = of_type(kPose);
  const Filter button = of_type(kButton, 2);
  const Filter held = where(kGaze, "x", Comparison::kLess, Scalar::of(1));
  EXPECT_EQ(interest_set_of(everything()), InterestSet{Match{}});
  EXPECT_EQ(interest_set_of(pose), InterestSet{of(kPose)});
  EXPECT_EQ(interest_set_of(masked(16, 0xf0, 1, 3)), (InterestSet{{16, 0xf0, 1, 3}}));
  EXPECT_EQ(interest_set_of(held), InterestSet{of(kGaze)});
  EXPECT_EQ(interest_set_of(any_of({pose, button})), (InterestSet{of(kPose), of(kButton, 2, 0)}));
  EXPECT_EQ(interest_set_of(all_of({everything(), pose})), InterestSet{of(kPose)});
  EXPECT_EQ(interest_set_of(none_of(pose)), InterestSet{Match{}});
  EXPECT_EQ(interest_set_of(correlate({pose, held})), (InterestSet{of(kPose), of(kGaze)}));
  // A conjunction also keeps events that the comparison beside it rejects.
  EXPECT_EQ(interest_set_of(all_of({held, correlate({pose})})),
            (InterestSet{of(kGaze), of(kPose)}));
  EXPECT_EQ(interest_set_of(listed({of(kPose), of(kGaze)})), (InterestSet{of(kPose), of(kGaze)}));
  for (const Filter& timeout : {once(1ms), every(1ms), silence(1ms)})
    EXPECT_EQ(interest_set_of(timeout), InterestSet{});
}

TEST(InterestSet, OmitsCoveredEntries) {
  EXPECT_EQ(unite_interest({}), InterestSet{});
  EXPECT_EQ(unite_interest({of(kPose, 3, 0), of(kPose), of(kPose, 4, 0)}),
            InterestSet{of(kPose, 1)});
  EXPECT_EQ(unite_interest({of(kPose), of(kButton), of(kPose)}),
            (InterestSet{of(kPose, 1), of(kButton, 1)}));
  EXPECT_EQ(unite_interest({of(kPose), {}, {16, 0xf0, 0, 0}}), (InterestSet{{.hops_min = 1}}));
  EXPECT_EQ(unite_interest({of(0x15), {0x10, 0xf0, 0, 0}}), (InterestSet{{0x10, 0xf0, 0, 0, 1}}));
}

// ev-5.2-2
TEST(InterestSet, AddsOneHopUpToTheMaximum) {
  EXPECT_EQ(unite_interest({of(kPose, 2), of(kPose, 5)}), InterestSet{of(kPose, 3)});
  // An entry with fewer hops does not cover a wider entry with more hops: both stay.
  EXPECT_EQ(unite_interest({of(kPose, 3, 0), of(kPose, 4)}),
            (InterestSet{of(kPose, 5), of(kPose, 3, 1)}));
  EXPECT_EQ(unite_interest({of(kPose, kLinkHopsMax - 1)}), InterestSet{of(kPose, kLinkHopsMax)});
  EXPECT_EQ(unite_interest({of(kPose, kLinkHopsMax), of(kGaze, 255)}), InterestSet{});
}

TEST(InterestSet, WidensTooManySourcesToTheirTypes) {
  InterestSet many;
  for (std::uint32_t i = 0; i <= kMatchCountMax; ++i)
    many.push_back(of(kPose + i % 2, i, 0));
  EXPECT_EQ(unite_interest(many), (InterestSet{of(kPose, 1), of(kButton, 1)}));
  for (std::uint32_t i = 0; i <= kMatchCountMax; ++i)
    many.push_back(of(100 + i));
  EXPECT_EQ(unite_interest(many), (InterestSet{{.hops_min = 1}}));
}

TEST(FilterList, AcceptsOnceWhatAnyOfItsMatchesAccepts) {
  Table table(listed({of(kPose, 3, 0),
                      of(kButton),
                      {0x40, 0xf0, 1, 1},
                      {.source = 3, .source_mask = kWholeNumber}}));
  table.push(kPose, 3);
  table.push(kPose, 4);
  table.push(kButton, 9);
  table.push(kGaze);
  table.push(0x4a, 3);
  table.push(0x4a, 2);
  EXPECT_EQ(table.got(), "5.3#1 6.9#1 74.3#1");
  EXPECT_EQ(table.got(table.subscribe(listed({}), {.replay = 1})), "");
}

// ev-5.2-4
TEST(FilterList, AcceptsOnlyEventsWithEnoughHops) {
  Table table(any_of({listed({of(kPose, 2), of(kButton, 7, 1)})}));
  const auto push = [&](EventType type, SourceId source, std::uint8_t hops) {
    const EventHeader header{.type = type, .source = source, .sequence = hops, .hops_left = hops};
    EXPECT_TRUE(table.exchange.offer({header, {}}, table.now));
  };
  push(kPose, 0, 1);
  push(kPose, 0, 2);
  push(kButton, 7, 0);
  push(kButton, 7, 1);
  EXPECT_EQ(table.got(), "5.0#2 6.7#1");
}

TEST(FilterList, RefusesMoreThanTheMaximum) {
  InterestSet many;
  for (std::uint32_t i = 0; i < kMatchCountMax; ++i)
    many.push_back(of(1 + i));
  Table table(listed(many));
  table.push(1);
  table.push(kMatchCountMax);
  table.push(kMatchCountMax + 1);
  EXPECT_EQ(table.got(), "1.0#1 1024.0#1");
  many.push_back(of(5000));
  const auto refused = CompiledFilter::compile(listed(many), table.catalog);
  ASSERT_FALSE(refused);
  rtpm::test::expect_text(refused.error().text(), {"1024 matches"});
}

}  // namespace
}  // namespace rtpm::events::test
