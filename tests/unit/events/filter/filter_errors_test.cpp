#include <gtest/gtest.h>

#include "rtpm/test/text.hpp"
#include "table.hpp"

namespace rtpm::events::test {
namespace {

using namespace std::chrono_literals;
using rtpm::test::expect_text;

/// The reason why the filter is refused; fails the test if it is not.
std::string refusal_of(const Filter& filter) {
  const TypeCatalog catalog = pose_catalog();
  const auto compiled = CompiledFilter::compile(filter, catalog);
  EXPECT_FALSE(compiled);
  return compiled ? "" : compiled.error().text();
}

Filter nested(std::size_t depth) {
  Filter filter = everything();
  for (std::size_t i = 1; i < depth; ++i)
    filter = none_of(filter);
  return filter;
}

TEST(FilterErrors, NamesAnUnknownTypeOrFieldAndItsPosition) {
  expect_text(refusal_of(any_of({of_type(kPose), where(kPose, "q", Comparison::kLess, {})})),
              {"any[1].where", "event type 5 (lab.Pose)", "'q'"});
  expect_text(refusal_of(where(77, "x", Comparison::kLess, {})), {"where", "event type 77", "'x'"});
}

TEST(FilterErrors, NamesTheFieldThatCannotHoldTheOperand) {
  expect_text(refusal_of(where(kPose, "keys", Comparison::kEqual, Scalar::of(256))),
              {"'keys'", "256", "uint8"});
  expect_text(refusal_of(where(kPose, "step", Comparison::kLess, Scalar::of(-32769))),
              {"'step'", "-32769", "int16"});
  expect_text(refusal_of(where(kPose, "step", Comparison::kLess, Scalar::of(0.5))),
              {"'step'", "0.5", "int16"});
  expect_text(refusal_of(where(kPose, "is_held", Comparison::kLess, Scalar::of(true))),
              {"'is_held'", "bool"});
  expect_text(refusal_of(where(kPose, "x", Comparison::kHasAnyBit, Scalar::of(1))),
              {"'x'", "double", "bits"});
}

TEST(FilterErrors, AcceptsAnOperandOfAnotherKindIfItsValueFits) {
  const TypeCatalog catalog = pose_catalog();
  for (const Scalar operand : {Scalar::of(-5), Scalar::of(-5.0)}) {
    EXPECT_TRUE(
        CompiledFilter::compile(where(kPose, "step", Comparison::kEqual, operand), catalog));
    EXPECT_TRUE(CompiledFilter::compile(where(kPose, "x", Comparison::kEqual, operand), catalog));
  }
}

TEST(FilterErrors, RefusesFiltersAboveTheLimits) {
  const TypeCatalog catalog = pose_catalog();
  EXPECT_TRUE(CompiledFilter::compile(nested(kFilterDepthMax), catalog));
  expect_text(refusal_of(nested(kFilterDepthMax + 1)), {"16 deep"});
  const auto wide = [](std::size_t nodes) {
    return any_of(std::vector<Filter>(nodes - 1, everything()));
  };
  EXPECT_TRUE(CompiledFilter::compile(wide(kFilterNodeCountMax), catalog));
  expect_text(refusal_of(wide(kFilterNodeCountMax + 1)), {"64 nodes"});
  const auto conjunction = [](std::size_t count) {
    return correlate(std::vector<Filter>(count, of_type(kPose)));
  };
  EXPECT_TRUE(CompiledFilter::compile(conjunction(kGroupSizeMax), catalog));
  expect_text(refusal_of(conjunction(kGroupSizeMax + 1)), {"32 events together"});
}

TEST(FilterErrors, GroupsNeedChildrenAndLeavesTakeNone) {
  expect_text(refusal_of(any_of({})), {"any", "no children"});
  Filter leaf = of_type(kPose);
  leaf.children.push_back(everything());
  expect_text(refusal_of(leaf), {"match", "takes no children"});
  Filter two{.kind = Filter::Kind::kNot, .children = {everything(), everything()}};
  expect_text(refusal_of(two), {"not", "exactly one child"});
}

TEST(FilterErrors, RefusesATimeoutThatNoEventCanMeet) {
  expect_text(refusal_of(all_of({of_type(kPose), once(1ms)})), {"all", "timeout"});
  expect_text(refusal_of(none_of(any_of({everything(), every(1ms)}))), {"not", "timeout"});
}

TEST(FilterErrors, TimeoutOutOfBoundsIsRefused) {
  expect_text(refusal_of(every(99us)), {"every", "99000 ns"});
  expect_text(refusal_of(silence(25h)), {"silence", "not between"});
  expect_text(refusal_of(correlate({everything()}, -1ns)), {"correlate", "negative"});
}

TEST(FilterErrors, PolicyOutOfBoundsIsRefused) {
  const TypeCatalog catalog = pose_catalog();
  const auto text = [&](const DeliveryPolicy& policy) {
    const auto gate = Gate::make(policy, catalog);
    EXPECT_FALSE(gate);
    return gate ? "" : gate.error().text();
  };
  expect_text(text({.every_nth = 0}), {"every_nth"});
  expect_text(text({.interval = -1ms}), {"interval"});
  expect_text(text({.queue_capacity = 0}), {"queue"});
  expect_text(text({.when_full = QueuePolicy::kKeepLatest, .queue_capacity = 65}), {"1 to 64"});
  expect_text(text({.replay = 65}), {"64", "replays"});
  expect_text(text({.deadbands = {{kPose, "q", 1}}}), {"lab.Pose", "'q'"});
  expect_text(text({.deadbands = {{kPose, "x", 0}}}), {"'x'", "above 0"});
}

TEST(FilterErrors, CatalogAcceptsOneSchemaPerType) {
  TypeCatalog catalog = pose_catalog();
  EXPECT_TRUE(catalog.add({kPose, "lab.Pose", kPoseSchema, kPoseFields}));
  const auto other = catalog.add({kPose, "lab.Position", 0x2222, {}});
  ASSERT_FALSE(other);
  expect_text(other.error().text(), {"event type 5 (lab.Position)", "lab.Pose", "schema"});
  EXPECT_FALSE(catalog.add({0, "none", 1, {}}));
}

}  // namespace
}  // namespace rtpm::events::test
