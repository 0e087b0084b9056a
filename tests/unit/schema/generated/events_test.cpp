#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <chrono>
#include <deque>
#include <limits>
#include <map>
#include <memory>
#include <string>
#include <type_traits>

#include "quantities.rtpm.events.hpp"
#include "rtpm/events/defaults.hpp"
#include "rtpm/events/hub.hpp"
#include "rtpm/rpc/node.hpp"
#include "rtpm/test/os.hpp"
#include "rtpm/test/serve.hpp"

// Generated descriptors of events, against payloads written by the data types.
namespace {

using lab::quantities::MovedEvent;
using lab::quantities::TouchedEvent;
using rtpm::events::read_scalar;
using rtpm::events::Scalar;

/// All numbers of a payload by its descriptor.
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

TEST(GeneratedEvents, StructEventsAreTheBareStruct) {
  static_assert(TouchedEvent::kIsStruct && TouchedEvent::kType == 4711);
  const TouchedEvent::Payload force(1, -2, 0.5);
  const auto found = numbers(TouchedEvent::kDescriptor, rtpm::rpc::struct_bytes(force));
  EXPECT_EQ(found, (std::map<std::string, Scalar>{
                       {"x", Scalar::of(1.0)}, {"y", Scalar::of(-2.0)}, {"z", Scalar::of(0.5)}}));
  EXPECT_EQ(TouchedEvent::kDescriptor.name, "lab.quantities.Touched");
  EXPECT_NE(TouchedEvent::kSchemaId, 0u);
}

TEST(GeneratedEvents, TablesNamedEventGetNoSecondSuffix) {
  using lab::quantities::LeftEventTraits;
  EXPECT_EQ(LeftEventTraits::kDescriptor.name, "lab.quantities.LeftEvent");
  static_assert(
      std::is_same_v<lab::quantities::LeftSupplier, rtpm::events::TypedSupplier<LeftEventTraits>>);
  static_assert(
      std::is_same_v<lab::quantities::LeftConsumer, rtpm::events::TypedConsumer<LeftEventTraits>>);
}

std::map<std::string, Scalar> numbers_of(const lab::quantities::MovedT& moved) {
  flatbuffers::FlatBufferBuilder builder;
  builder.Finish(MovedEvent::Payload::Pack(builder, &moved));
  return numbers(MovedEvent::kDescriptor, rtpm::rpc::table_bytes(builder));
}

TEST(GeneratedEvents, TableEventsHaveThePathOfEachNumber) {
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

TEST(GeneratedEvents, NumbersMissingInThePayloadHaveDefaults) {
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

/// A hub behind a server.
class TypedEvents : public testing::Test {
 protected:
  static constexpr std::chrono::seconds kPatience{20};

  TypedEvents() {
    rtpm::events::HubConfig config;
    config.realtime = rtpm::rt::RealtimeMode::kOff;
    config.priority.reset();
    hub_ = *rtpm::events::Hub::create(config);
    server_ = rtpm::test::serve(rtpm::events::kHubPath, hub_->servant());
    url_ = server_->url(rtpm::events::kHubPath);
  }
  ~TypedEvents() override { server_->stop(); }

  /// Options of a consumer that reports its subscription.
  template <class Consumer>
  Consumer consume(typename Consumer::OnEvent on_event, rtpm::events::ConsumerConfig config = {}) {
    config.realtime = rtpm::rt::RealtimeMode::kOff;
    std::atomic<bool>& is_there = is_there_.emplace_back(false);
    auto consumer = Consumer::create(
        node_, url_, std::move(on_event), std::move(config), [&](const auto& notice) {
          is_there = is_there || notice.kind == rtpm::events::NoticeKind::kSubscribed;
        });
    EXPECT_TRUE(consumer) << consumer.error().text();
    EXPECT_TRUE(rtpm::test::await([&] { return is_there.load(); })) << "no subscription";
    return std::move(*consumer);
  }

  std::unique_ptr<rtpm::events::Hub> hub_;
  std::unique_ptr<rtpm::rpc::Server> server_;
  std::string url_;
  rtpm::rpc::Node node_;
  std::deque<std::atomic<bool>> is_there_;
};

TEST_F(TypedEvents, ReachTheirConsumers) {
  std::atomic<double> touched_x{0};
  std::atomic<std::uint32_t> touched_by{0};
  std::atomic<int> step{0};
  const auto touched = consume<lab::quantities::TouchedConsumer>(
      [&](const lab::quantities::Force& force, const rtpm::events::EventHeader& header) {
        touched_by = header.source;
        touched_x = force.x();
      });
  rtpm::events::ConsumerConfig only_far;
  only_far.filter = rtpm::events::where(MovedEvent::kType, "distance_m",
                                        rtpm::events::Comparison::kGreater, Scalar::of(1.0));
  const auto moved = consume<lab::quantities::MovedConsumer>(
      [&](const lab::quantities::Moved& event, const auto&) { step += event.step(); }, only_far);

  auto touches = lab::quantities::TouchedSupplier::create(node_, url_, 3);
  auto moves = lab::quantities::MovedSupplier::create(*hub_);
  ASSERT_TRUE(touches) << touches.error().text();
  ASSERT_TRUE(moves) << moves.error().text();
  ASSERT_TRUE(touches->push({1.5, 0, 0}));
  for (const auto& [distance, steps] : {std::pair{0.5, std::int16_t{100}}, {2.0, 7}}) {
    flatbuffers::FlatBufferBuilder builder;
    lab::quantities::MovedT event;
    event.distance_m = distance;
    event.step = steps;
    builder.Finish(lab::quantities::Moved::Pack(builder, &event));
    ASSERT_TRUE(moves->add(builder));
  }
  ASSERT_TRUE(moves->flush());
  EXPECT_TRUE(rtpm::test::await([&] { return touched_x > 1.4 && step != 0; }));
  EXPECT_EQ(touched_by, 3u);
  EXPECT_EQ(step, 7) << "what is near was filtered by the hub";
}

TEST_F(TypedEvents, AreDroppedAndCountedWithAnotherSchema) {
  std::atomic<int> count{0};
  auto touched =
      consume<lab::quantities::TouchedConsumer>([&](const auto&, const auto&) { ++count; });
  auto supplier = rtpm::events::Supplier::create(node_, url_);
  ASSERT_TRUE(supplier) << supplier.error().text();
  const lab::quantities::Force force(1, 2, 3);
  const rtpm::ConstBytes bytes = rtpm::rpc::struct_bytes(force);
  ASSERT_TRUE((*supplier)->push({.type = TouchedEvent::kType, .schema_id = 1, .payload = bytes}));
  ASSERT_TRUE((*supplier)->push({.type = TouchedEvent::kType, .payload = bytes.first(8)}));
  ASSERT_TRUE((*supplier)->push({.type = TouchedEvent::kType, .payload = bytes}));
  EXPECT_TRUE(rtpm::test::await([&] { return count == 1; }));
  EXPECT_EQ(touched.bad_payload_count(), 2u);
}

}  // namespace
