#include <gtest/gtest.h>

#include <sstream>
#include <string>
#include <vector>

#include "table.hpp"

// Each sentence of filter.hpp about a node or a timeout, as a row of events on a clock.
namespace rtpm::events::test {
namespace {

using namespace std::chrono_literals;

/// A filter, a row of events and the resulting deliveries.
struct Row {
  const char* sentence;
  Filter filter;
  const char* events;      ///< "5.1" is type 5 of source 1, "t9" the time 9 ms, "|" a check.
  const char* deliveries;  ///< Those of each check and of the end.
};

std::string deliveries_of(const Row& row) {
  Table table(row.filter);
  std::string found;
  std::istringstream words(row.events);
  for (std::string word; words >> word;) {
    if (word == "|") {
      found += table.got() + " | ";
    } else if (word[0] == 't') {
      table.advance(std::stod(word.substr(1)));
    } else {
      const std::size_t dot = word.find('.');
      const std::string source = dot == word.npos ? "0" : word.substr(dot + 1);
      table.push(static_cast<EventType>(std::stoul(word)),
                 static_cast<SourceId>(std::stoul(source)));
    }
  }
  return found + table.got();
}

void expect_deliveries(const std::vector<Row>& rows) {
  for (const Row& row : rows)
    EXPECT_EQ(deliveries_of(row), row.deliveries) << row.sentence;
}

const Filter kPoses = of_type(kPose);
const Filter kButtons = of_type(kButton);
const Filter kGazes = of_type(kGaze);
const Filter kPoseAndButton = correlate({kPoses, kButtons});
const Filter kPoseNearGaze = correlate({kPoses, kGazes}, 5ms);

TEST(FilterTable, SingleEventsAreAcceptedByTypeAndSource) {
  expect_deliveries({
      {"everything", everything(), "5 6.3", "5.0#1 6.3#1"},
      {"a type from any source", kPoses, "5.1 6.1 5", "5.1#1 5.0#1"},
      {"type and source only both", of_type(kPose, 2), "5.1 5.2 6.2", "5.2#1"},
      {"source 0 of an event is no wildcard", of_type(kPose, 2), "5.0", ""},
      {"masks compare only their bits", masked(0x4, 0xfc, 0x10, 0xf0), "5.18 6.31 5.34 9.18",
       "5.18#1 6.31#1"},
      {"the mask of a source takes any type", masked(0, 0, 3, kWholeNumber), "5.3 7.3 7.4",
       "5.3#1 7.3#1"},
      {"any takes an event once", any_of({kPoses, kButtons, masked(0, 0, 1, kWholeNumber)}),
       "5.1 6.2 7.1 7.2", "5.1#1 6.2#1 7.1#1"},
      {"all", all_of({kPoses, masked(0, 0, 1, 1)}), "5.1 5.2 6.1", "5.1#1"},
      {"not", none_of(any_of({kPoses, of_type(kButton, 1)})), "5 6.1 6.2 7", "6.2#1 7.0#1"},
  });
}

TEST(FilterTable, ConjunctionsAreCompletedByTheirLastEvent) {
  expect_deliveries({
      {"in the order of its children", kPoseAndButton, "6 | 5", " | 5.0#1+6.0#1"},
      {"the newest of each child", kPoseAndButton, "5 5 5 6", "5.0#3+6.0#1"},
      {"it begins anew", kPoseAndButton, "5 6 6 | 5", "5.0#1+6.0#1 | 5.0#2+6.0#2"},
      {"within its skew; the gaze is kept", kPoseNearGaze, "t0 5 t6 7 | t11 5", " | 5.0#2+7.0#1"},
      {"each child has its own event", correlate({kPoses, kPoses}), "t1 5 | t2 5",
       " | 5.0#1+5.0#2"},
      {"the oldest of those that accept is replaced", correlate({kPoses, kPoses, kButtons}),
       "t1 5 t2 5 t3 5 6", "5.0#3+5.0#2+6.0#1"},
      {"a conjunction in another", correlate({kPoseAndButton, kGazes}), "5 7 6",
       "5.0#1+6.0#1+7.0#1"},
      {"beside a neighbour", any_of({kPoses, kPoseAndButton}), "5 | 6", "5.0#1 | 5.0#1+6.0#1"},
      {"any delivers what its event completes, if it is first", any_of({kPoseAndButton, kPoses}),
       "6 5 5 6", "5.0#1+6.0#1 5.0#2 5.0#2+6.0#2"},
      {"and if it is last", any_of({kPoses, kPoseAndButton}), "6 5 5 6",
       "5.0#1+6.0#1 5.0#2 5.0#2+6.0#2"},
      {"any delivers the largest, and all nodes start over",
       any_of({all_of({kPoses, masked(0, 0, 0, kWholeNumber)}), any_of({kPoses, kPoseAndButton}),
               correlate({kPoses, kButtons, kGazes}), correlate({kGazes, kPoses})}),
       "6 5 | 7 | 7 5", "5.0#1+6.0#1 | 5.0#1+6.0#1+7.0#1 | 7.0#2+5.0#2"},
      {"a button, or a pose near a gaze", any_of({kButtons, kPoseNearGaze}),
       "t0 5 t1 6 t4 7 t20 5 t40 7", "6.0#1 5.0#1+7.0#1"},
  });
}

TEST(FilterTable, TimeoutsComeAtTheirTime) {
  const Filter silent = any_of({kPoses, silence(10ms, 9)});
  expect_deliveries({
      {"once", any_of({kPoses, once(10ms, 9)}), "t9 5 t9.9 | t100", "5.0#1 | @9"},
      {"every, whatever else comes", any_of({kPoses, every(10ms, 9)}), "t5 5 t15 5 t30",
       "5.0#1 @9 5.0#2 @9 @9"},
      {"silence after the last delivery", silent, "t8 5 t16 5 t25 | t26 | t35.9 | t36",
       "5.0#1 5.0#2 | @9 |  | @9"},
      {"a rejected event does not end a silence", silent, "t8 6 t10", "@9"},
      {"nor does one outside of its group", any_of({kButtons, silent}), "t8 6 t10", "6.0#1 @9"},
      {"silence alone", silence(10ms, 9), "t30", "@9 @9 @9"},
      {"a conjunction ends a silence",
       any_of({kButtons, any_of({kPoseNearGaze, silence(10ms, 9)})}), "t1 5 t3 7 t8 6 t12.9 | t13",
       "5.0#1+7.0#1 6.0#1 | @9"},
      {"a timeout is a child of a conjunction", correlate({kPoses, every(10ms, 9)}),
       "t1 5 | t10 | t20 t22 5", " | 5.0#1+@9 | 5.0#2+@9"},
      {"its time is no skew", correlate({kPoses, every(10ms, 9)}, 1ms), "t1 5 t10", "5.0#1+@9"},
      {"both, or 5 ms", any_of({correlate({kPoses, kGazes}), silence(5ms, 9)}), "t1 5 t3 7 t8",
       "5.0#1+7.0#1 @9"},
      {"a timeout is no event for other nodes",
       any_of({none_of(kPoses), correlate({everything(), once(5ms, 9)})}), "t5", ""},
  });
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

TEST(FilterTable, WhereComparesFloatsAtTheirPrecision) {
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

TEST(TimeoutTable, EverySkipsMissedPeriodsAndKeepsItsPhase) {
  Table table(every(10ms, 9));
  table.exchange.on_time(at(35));
  EXPECT_EQ(table.got(), "@9");
  EXPECT_EQ(table.exchange.next_time(), at(40));
}

TEST(TimeoutTable, TimeoutHasItsDueTimeAndCount) {
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
