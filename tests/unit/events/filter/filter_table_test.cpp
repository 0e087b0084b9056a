#include <gtest/gtest.h>

#include "table.hpp"

// Each sentence of filter.hpp about a node or a timeout, as a row of events on a clock.
namespace rtpm::events::test {
namespace {

using namespace std::chrono_literals;

TEST(FilterTable, EverythingAcceptsEveryEvent) {
  Table table(everything());
  table.push(kPose);
  table.push(kButton, 3);
  EXPECT_EQ(table.got(), "5.0#1 6.3#1");
}

TEST(FilterTable, TypeAcceptsItsTypeFromAnySource) {
  Table table(of_type(kPose));
  table.push(kPose, 1);
  table.push(kButton, 1);
  table.push(kPose, 0);
  EXPECT_EQ(table.got(), "5.1#1 5.0#1");
}

TEST(FilterTable, TypeAndSourceAcceptOnlyBoth) {
  Table table(of_type(kPose, 2));
  table.push(kPose, 1);
  table.push(kPose, 2);
  table.push(kButton, 2);
  EXPECT_EQ(table.got(), "5.2#1");
}

TEST(FilterTable, SourceZeroOfAnEventIsASourceAndNoWildcard) {
  Table table(of_type(kPose, 2));
  table.push(kPose, 0);
  EXPECT_EQ(table.got(), "");
}

TEST(FilterTable, MasksCompareOnlyTheirBits) {
  Table table(masked(0x4, 0xfc, 0x10, 0xf0));
  table.push(kPose, 0x12);
  table.push(kButton, 0x1f);
  table.push(kPose, 0x22);
  table.push(9, 0x12);
  EXPECT_EQ(table.got(), "5.18#1 6.31#1");
}

TEST(FilterTable, MaskOfSourceAloneTakesAnyType) {
  Table table(masked(0, 0, 3, kWholeNumber));
  table.push(kPose, 3);
  table.push(kGaze, 3);
  table.push(kGaze, 4);
  EXPECT_EQ(table.got(), "5.3#1 7.3#1");
}

TEST(FilterTable, AnyAcceptsWhatOneChildAcceptsAndOnlyOnce) {
  Table table(any_of({of_type(kPose), of_type(kButton), masked(0, 0, 1, kWholeNumber)}));
  table.push(kPose, 1);
  table.push(kButton, 2);
  table.push(kGaze, 1);
  table.push(kGaze, 2);
  EXPECT_EQ(table.got(), "5.1#1 6.2#1 7.1#1");
}

TEST(FilterTable, AllAcceptsAnEventThatAllChildrenAccept) {
  Table table(all_of({of_type(kPose), masked(0, 0, 1, 1)}));
  table.push(kPose, 1);
  table.push(kPose, 2);
  table.push(kButton, 1);
  EXPECT_EQ(table.got(), "5.1#1");
}

TEST(FilterTable, NotAcceptsWhatItsChildDoesNot) {
  Table table(none_of(any_of({of_type(kPose), of_type(kButton, 1)})));
  table.push(kPose);
  table.push(kButton, 1);
  table.push(kButton, 2);
  table.push(kGaze);
  EXPECT_EQ(table.got(), "6.2#1 7.0#1");
}

TEST(FilterTable, WhereComparesAFieldOfItsTypeOnly) {
  const PosePayload far{.x = 1.5};
  Table table(where(kPose, "x", Comparison::kGreater, Scalar::of(1.0)));
  table.push(kPose, 0, {.x = 1.0});
  table.push(kPose, 0, far);
  table.push(kButton, 0, far);
  EXPECT_EQ(table.got(), "5.0#2");
}

TEST(FilterTable, WhereKnowsEveryComparison) {
  using enum Comparison;
  const auto accepted = [](Comparison comparison) {
    Table table(where(kPose, "step", comparison, Scalar::of(-3)));
    for (const std::int16_t step : std::array<std::int16_t, 3>{-4, -3, 2})
      table.push(kPose, 0, {.step = step});
    return table.got();
  };
  EXPECT_EQ(accepted(kEqual), "5.0#2");
  EXPECT_EQ(accepted(kNotEqual), "5.0#1 5.0#3");
  EXPECT_EQ(accepted(kLess), "5.0#1");
  EXPECT_EQ(accepted(kLessOrEqual), "5.0#1 5.0#2");
  EXPECT_EQ(accepted(kGreater), "5.0#3");
  EXPECT_EQ(accepted(kGreaterOrEqual), "5.0#2 5.0#3");
  Table bits(where(kPose, "keys", kHasAnyBit, Scalar::of(6)));
  bits.push(kPose, 0, {.keys = 1});
  bits.push(kPose, 0, {.keys = 3});
  EXPECT_EQ(bits.got(), "5.0#2");
}

TEST(FilterTable, WhereTakesAFloatAsPreciselyAsItIs) {
  Table table(where(kPose, "force", Comparison::kEqual, Scalar::of(0.1)));
  table.push(kPose, 0, {.force = 0.1F});
  EXPECT_EQ(table.got(), "5.0#1");
}

TEST(FilterTable, WhereRejectsAPayloadOfAnotherSchemaOrTooShort) {
  Table table(where(kPose, "x", Comparison::kGreaterOrEqual, Scalar::of(0.0)));
  const PosePayload payload{};
  const auto bytes = std::as_bytes(std::span<const PosePayload, 1>(&payload, 1));
  EXPECT_TRUE(table.exchange.offer({{.type = kPose, .schema_id = 7}, bytes}, {}));
  EXPECT_TRUE(
      table.exchange.offer({{.type = kPose, .schema_id = kPoseSchema}, bytes.first(4)}, {}));
  EXPECT_EQ(table.got(), "");
}

TEST(FilterTable, CorrelateWaitsForAllAndDeliversInTheOrderOfItsChildren) {
  Table table(correlate({of_type(kPose), of_type(kButton)}));
  table.push(kButton);
  EXPECT_EQ(table.got(), "");
  table.push(kPose);
  EXPECT_EQ(table.got(), "5.0#1+6.0#1");
}

TEST(FilterTable, CorrelateKeepsTheNewestOfEachChild) {
  Table table(correlate({of_type(kPose), of_type(kButton)}));
  table.push(kPose);
  table.push(kPose);
  table.push(kPose);
  table.push(kButton);
  EXPECT_EQ(table.got(), "5.0#3+6.0#1");
}

TEST(FilterTable, CorrelateBeginsAnewAfterADelivery) {
  Table table(correlate({of_type(kPose), of_type(kButton)}));
  table.push(kPose);
  table.push(kButton);
  table.push(kButton);
  EXPECT_EQ(table.got(), "5.0#1+6.0#1");
  table.push(kPose);
  EXPECT_EQ(table.got(), "5.0#2+6.0#2");
}

TEST(FilterTable, CorrelateDeliversOnlyWhatHappenedWithinItsSkew) {
  Table table(correlate({of_type(kPose), of_type(kGaze)}, 5ms));
  table.push_at(0, kPose);
  table.push_at(6, kGaze);
  EXPECT_EQ(table.got(), "");
  // The node keeps the gaze; the newer pose is near it.
  table.push_at(11, kPose);
  EXPECT_EQ(table.got(), "5.0#2+7.0#1");
}

TEST(FilterTable, CorrelateFillsEachChildWithAnEventOfItsOwn) {
  Table table(correlate({of_type(kPose), of_type(kPose)}));
  table.push_at(1, kPose);
  EXPECT_EQ(table.got(), "");
  table.push_at(2, kPose);
  EXPECT_EQ(table.got(), "5.0#1+5.0#2");
}

TEST(FilterTable, CorrelateReplacesTheOldestOfThoseThatAccept) {
  Table table(correlate({of_type(kPose), of_type(kPose), of_type(kButton)}));
  for (int i = 1; i <= 3; ++i)
    table.push_at(i, kPose);
  table.push(kButton);
  EXPECT_EQ(table.got(), "5.0#3+5.0#2+6.0#1");
}

TEST(FilterTable, CorrelateHoldsWhatAnotherHolds) {
  Table table(correlate({correlate({of_type(kPose), of_type(kButton)}), of_type(kGaze)}));
  table.push(kPose);
  table.push(kGaze);
  table.push(kButton);
  EXPECT_EQ(table.got(), "5.0#1+6.0#1+7.0#1");
}

TEST(FilterTable, ConjunctionSeesWhatANeighbourAccepts) {
  Table table(any_of({of_type(kPose), correlate({of_type(kPose), of_type(kButton)})}));
  table.push(kPose);
  EXPECT_EQ(table.got(), "5.0#1");
  table.push(kButton);
  EXPECT_EQ(table.got(), "5.0#1+6.0#1");
}

TEST(FilterTable, AnyDeliversTheConjunctionThatItsEventCompletes) {
  for (const bool is_first : {false, true}) {
    Filter pair = correlate({of_type(kPose), of_type(kButton)});
    Table table(is_first ? any_of({std::move(pair), of_type(kPose)})
                         : any_of({of_type(kPose), std::move(pair)}));
    table.push(kButton);
    table.push(kPose);
    table.push(kPose);
    table.push(kButton);
    EXPECT_EQ(table.got(), "5.0#1+6.0#1 5.0#2 5.0#2+6.0#2");
  }
}

TEST(FilterTable, AnyDeliversTheLargestConjunctionThatItsEventCompletes) {
  Table table(any_of({all_of({of_type(kPose), masked(0, 0, 0, kWholeNumber)}),
                      any_of({of_type(kPose), correlate({of_type(kPose), of_type(kButton)})}),
                      correlate({of_type(kPose), of_type(kButton), of_type(kGaze)}),
                      correlate({of_type(kGaze), of_type(kPose)})}));
  table.push(kButton);
  table.push(kPose);
  EXPECT_EQ(table.got(), "5.0#1+6.0#1");
  table.push(kGaze);
  EXPECT_EQ(table.got(), "5.0#1+6.0#1+7.0#1");
  // All nodes start over, including those that were not delivered.
  table.push(kGaze);
  table.push(kPose);
  EXPECT_EQ(table.got(), "7.0#2+5.0#2");
}

TEST(FilterTable, SilenceBesideAConjunctionIsEndedByIt) {
  Table table(any_of({of_type(kButton), any_of({correlate({of_type(kPose), of_type(kGaze)}, 5ms),
                                                silence(10ms, 9)})}));
  table.push_at(1, kPose);
  table.push_at(3, kGaze);
  table.push_at(8, kButton);
  table.advance(12.9);
  EXPECT_EQ(table.got(), "5.0#1+7.0#1 6.0#1");
  table.advance(13);
  EXPECT_EQ(table.got(), "@9");
}

TEST(FilterTable, ButtonOrPoseAndGazeWithinFiveMilliseconds) {
  Table table(any_of({of_type(kButton), correlate({of_type(kPose), of_type(kGaze)}, 5ms)}));
  table.push_at(0, kPose);
  table.push_at(1, kButton);
  table.push_at(4, kGaze);
  table.push_at(20, kPose);
  table.push_at(40, kGaze);
  EXPECT_EQ(table.got(), "6.0#1 5.0#1+7.0#1");
}

TEST(FilterTable, AllUnitesTheGroupsOfItsChildren) {
  Table table(all_of({correlate({of_type(kPose), of_type(kButton)}),
                      where(kPose, "step", Comparison::kEqual, Scalar::of(1))}));
  table.push(kButton);
  table.push(kPose, 0, {.step = 1});
  EXPECT_EQ(table.got(), "5.0#1+6.0#1");
  // The event completes the node, but the other child does not accept it.
  table.push(kPose, 0, {.step = 1});
  table.push(kButton);
  EXPECT_EQ(table.got(), "");
}

TEST(TimeoutTable, OnceComesOnceAfterTheSubscription) {
  Table table(any_of({of_type(kPose), once(10ms, 9)}));
  table.push_at(9, kPose);
  table.advance(9.9);
  EXPECT_EQ(table.got(), "5.0#1");
  table.advance(100);
  EXPECT_EQ(table.got(), "@9");
  EXPECT_EQ(table.exchange.next_time(), kNever);
}

TEST(TimeoutTable, EveryComesAtItsPaceWhateverElseComes) {
  Table table(any_of({of_type(kPose), every(10ms, 9)}));
  table.push_at(5, kPose);
  table.push_at(15, kPose);
  table.advance(30);
  EXPECT_EQ(table.got(), "5.0#1 @9 5.0#2 @9 @9");
}

TEST(TimeoutTable, EveryDoesNotMakeUpForWhatWasMissedAndKeepsItsPhase) {
  Table table(every(10ms, 9));
  table.exchange.on_time(at(35));
  EXPECT_EQ(table.got(), "@9");
  EXPECT_EQ(table.exchange.next_time(), at(40));
}

TEST(TimeoutTable, SilenceComesWhenItsGroupDeliveredNothingForItsTime) {
  Table table(any_of({of_type(kPose), silence(10ms, 9)}));
  table.push_at(8, kPose);
  table.push_at(16, kPose);
  table.advance(25);
  EXPECT_EQ(table.got(), "5.0#1 5.0#2");
  table.advance(26);
  EXPECT_EQ(table.got(), "@9");
  table.advance(35.9);
  EXPECT_EQ(table.got(), "");
  table.advance(36);
  EXPECT_EQ(table.got(), "@9");
}

TEST(TimeoutTable, SilenceIsNotEndedByWhatItsGroupRejects) {
  Table table(any_of({of_type(kPose), silence(10ms, 9)}));
  table.push_at(8, kButton);
  table.advance(10);
  EXPECT_EQ(table.got(), "@9");
}

TEST(TimeoutTable, SilenceBelongsToTheGroupAroundItOnly) {
  Table table(any_of({of_type(kButton), any_of({of_type(kPose), silence(10ms, 9)})}));
  table.push_at(8, kButton);
  table.advance(10);
  EXPECT_EQ(table.got(), "6.0#1 @9");
}

TEST(TimeoutTable, SilenceAloneComesAtItsPace) {
  Table table(silence(10ms, 9));
  table.advance(30);
  EXPECT_EQ(table.got(), "@9 @9 @9");
}

TEST(TimeoutTable, TimeoutCountsAsAChildOfAConjunction) {
  Table table(correlate({of_type(kPose), every(10ms, 9)}));
  table.push_at(1, kPose);
  EXPECT_EQ(table.got(), "");
  table.advance(10);
  EXPECT_EQ(table.got(), "5.0#1+@9");
  table.advance(20);
  table.push_at(22, kPose);
  EXPECT_EQ(table.got(), "5.0#2+@9");
}

TEST(TimeoutTable, TimeOfATimeoutIsNoSkew) {
  Table table(correlate({of_type(kPose), every(10ms, 9)}, 1ms));
  table.push_at(1, kPose);
  table.advance(10);
  EXPECT_EQ(table.got(), "5.0#1+@9");
}

TEST(TimeoutTable, BothOrFiveMilliseconds) {
  Table table(any_of({correlate({of_type(kPose), of_type(kGaze)}), silence(5ms, 9)}));
  table.push_at(1, kPose);
  table.push_at(3, kGaze);
  table.advance(8);
  EXPECT_EQ(table.got(), "5.0#1+7.0#1 @9");
}

TEST(TimeoutTable, TimeoutIsNoEventForOtherNodes) {
  Table table(any_of({none_of(of_type(kPose)), correlate({everything(), once(5ms, 9)})}));
  table.advance(5);
  EXPECT_EQ(table.got(), "");
}

TEST(TimeoutTable, TimeoutTellsWhenItWasDueAndHowOftenItCame) {
  Table table(every(10ms, 9));
  table.exchange.on_time(at(12));
  table.exchange.on_time(at(20));
  DeliveryQueue& queue = table.exchange.queue(table.number);
  ASSERT_EQ(queue.size(), 2U);
  EXPECT_EQ(queue[0].event.header().origin, at(10));
  EXPECT_EQ(queue[0].event.header().hub_received, at(12));
  EXPECT_EQ(queue[1].event.header().sequence, 2U);
}

}  // namespace
}  // namespace rtpm::events::test
