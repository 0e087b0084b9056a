#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <limits>
#include <map>
#include <string>

#include "quantities.rtpm.events.hpp"

// What generated code says of events, against payloads that its data types write.
namespace {

using lab::quantities::MovedEvent;
using lab::quantities::TouchedEvent;
using rtpm::events::read_scalar;
using rtpm::events::Scalar;

/// Every number of a payload that its descriptor finds.
std::map<std::string, Scalar> numbers(const rtpm::events::EventDescriptor& event,
                                      rtpm::ConstBytes payload) {
  std::map<std::string, Scalar> found;
  for (const auto& field : event.fields) {
    const auto value = read_scalar(payload, field.path, field.type, field.default_value);
    EXPECT_TRUE(value) << field.name;
    if (value) found.emplace(field.name, *value);
  }
  return found;
}

TEST(GeneratedEvents, OfAStructAreTheBareStruct) {
  static_assert(TouchedEvent::kIsStruct && TouchedEvent::kType == 4711);
  const TouchedEvent::Payload force(1, -2, 0.5);
  const auto found = numbers(TouchedEvent::kDescriptor, rtpm::rpc::struct_bytes(force));
  EXPECT_EQ(found, (std::map<std::string, Scalar>{
                       {"x", Scalar::of(1.0)}, {"y", Scalar::of(-2.0)}, {"z", Scalar::of(0.5)}}));
  EXPECT_EQ(TouchedEvent::kDescriptor.name, "lab.quantities.Touched");
  EXPECT_NE(TouchedEvent::kSchemaId, 0u);
}

std::map<std::string, Scalar> numbers_of(const lab::quantities::MovedT& moved) {
  flatbuffers::FlatBufferBuilder builder;
  builder.Finish(MovedEvent::Payload::Pack(builder, &moved));
  return numbers(MovedEvent::kDescriptor, rtpm::rpc::table_bytes(builder));
}

TEST(GeneratedEvents, OfATableSayWhereEachNumberStands) {
  static_assert(!MovedEvent::kIsStruct && MovedEvent::kType == 4712);
  lab::quantities::MovedT moved;
  moved.plane = std::make_unique<lab::quantities::PlaneT>();
  moved.plane->normal = std::make_unique<lab::quantities::Force>(1, 2, 3);
  moved.plane->distance_m = 4;
  moved.distance_m = 5;
  moved.step = -6;
  moved.count = 7;
  moved.is_held = false;
  const std::array<float, 6> angles{};
  moved.joints = std::make_unique<lab::quantities::Joints>(
      flatbuffers::span<const float, 6>(angles), std::uint8_t{8});
  moved.name = "tip";
  moved.maybe = 9;
  moved.least = 10;
  moved.endless = 11;
  const std::map<std::string, Scalar> expected{{"plane.normal.x", Scalar::of(1.0)},
                                               {"plane.normal.y", Scalar::of(2.0)},
                                               {"plane.normal.z", Scalar::of(3.0)},
                                               {"plane.distance_m", Scalar::of(4.0)},
                                               {"distance_m", Scalar::of(5.0)},
                                               {"step", Scalar::of(-6)},
                                               {"count", Scalar::of(std::uint64_t{7})},
                                               {"is_held", Scalar::of(false)},
                                               {"joints.mode", Scalar::of(std::uint64_t{8})},
                                               {"maybe", Scalar::of(9)},
                                               {"least", Scalar::of(10)},
                                               {"endless", Scalar::of(11.0)}};
  EXPECT_EQ(numbers_of(moved), expected);
}

TEST(GeneratedEvents, HaveDefaultsWhereThePayloadLeavesThemOut) {
  const auto found = numbers_of({});
  EXPECT_EQ(found.at("distance_m"), Scalar::of(0.5));
  EXPECT_EQ(found.at("step"), Scalar::of(-3));
  EXPECT_EQ(found.at("count"), Scalar::of(std::uint64_t{9'000'000'000}));
  EXPECT_EQ(found.at("is_held"), Scalar::of(true));
  EXPECT_EQ(found.at("least"), Scalar::of(std::numeric_limits<std::int64_t>::min()));
  EXPECT_EQ(found.at("endless"), Scalar::of(-std::numeric_limits<double>::infinity()));
  EXPECT_EQ(found.count("gone"), 0u) << "deprecated";
  EXPECT_EQ(found.at("plane.distance_m"), Scalar::of(0.0)) << "of a table that is absent";
}

}  // namespace
