#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <string>

#include "arm.rtpm.functions.hpp"
#include "quantities.rtpm.functions.hpp"

// Servants made of functions, and the checks of a skeleton before a method runs.
namespace {

using lab::quantities::Force;
using lab::quantities::SceneFunctionServant;
using lab::quantities::SceneMethodId;
using rtpm::rpc::CallContext;
using rtpm::rpc::Result;
using rtpm::wire::Status;

const CallContext kContext{.priority = 0, .deadline = rtpm::kNever, .received = {}};

/// Runs a method as a lane does.
struct Dispatch {
  alignas(16) std::array<std::byte, 4096> request{};
  alignas(16) std::array<std::byte, 4096> reply{};
  std::string text{};  ///< The last reply, or the reason why there is none.

  Status run(rtpm::rpc::Servant& servant, SceneMethodId id, rtpm::ConstBytes bytes) {
    std::ranges::copy(bytes, request.begin());
    const rtpm::rpc::DispatchResult result = servant.dispatch(
        static_cast<std::uint16_t>(id), {request.data(), bytes.size()}, reply, kContext);
    text.assign(reinterpret_cast<const char*>(reply.data()), result.reply_size);
    return result.status;
  }
  template <class T>
  Status run_table(rtpm::rpc::Servant& servant, SceneMethodId id, const T& request_object) {
    flatbuffers::FlatBufferBuilder builder;
    builder.Finish(T::TableType::Pack(builder, &request_object));
    return run(servant, id, rtpm::rpc::table_bytes(builder));
  }
};

TEST(FunctionServant, CallsItsFunctionsAndRefusesTheOthers) {
  int count = 0;
  SceneFunctionServant scene({.push = [&](const Force& force, const CallContext&) -> Result<Force> {
    ++count;
    return Force(force.x() + 1, force.y(), force.z());
  }});
  Dispatch dispatch;
  EXPECT_EQ(dispatch.run(scene, SceneMethodId::push, rtpm::rpc::struct_bytes(Force(1, 2, 3))),
            Status::kOk);
  EXPECT_EQ(rtpm::rpc::view_struct<Force>(dispatch.reply).x(), 2);
  EXPECT_EQ(count, 1);
  EXPECT_EQ(dispatch.run_table(scene, SceneMethodId::nested, lab::quantities::OuterT{}),
            Status::kNoSuchMethod);
  EXPECT_EQ(dispatch.run(scene, SceneMethodId{99}, {}), Status::kNoSuchMethod);
  EXPECT_EQ(scene.interface().name, "lab.quantities.Scene");
}

/// A scene that counts the calls that passed the checks.
class Ranges : public testing::Test {
 protected:
  Status push(const Force& force) {
    return dispatch_.run(scene_, SceneMethodId::push, rtpm::rpc::struct_bytes(force));
  }
  Status add(const lab::quantities::PartT& part) {
    return dispatch_.run_table(scene_, SceneMethodId::add, part);
  }
  Status echo(const lab::quantities::EverythingT& everything) {
    return dispatch_.run_table(scene_, SceneMethodId::echo, everything);
  }

  int count_ = 0;
  Dispatch dispatch_;
  SceneFunctionServant scene_{{
      .push = [&](const Force& force, const CallContext&) -> Result<Force> {
        ++count_;
        return force;
      },
      .add = [&](const lab::quantities::Part&, const CallContext&) -> Result<void> {
        ++count_;
        return {};
      },
      .echo = [&](const lab::quantities::Everything&,
                  rtpm::rpc::ReplyBuilder<lab::quantities::Everything>& reply,
                  const CallContext&) -> Result<void> {
        ++count_;
        reply.finish(lab::quantities::CreateEverything(reply.builder()));
        return {};
      },
  }};
};

TEST_F(Ranges, AreCheckedInStructs) {
  EXPECT_EQ(push(Force(-20, 0, 20)), Status::kOk);
  EXPECT_EQ(count_, 1);
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  for (const Force& wrong :
       {Force(20.1, 0, 0), Force(0, -20.1, 0), Force(0, 0, kNan), Force(kInfinity, 0, 0)}) {
    EXPECT_EQ(push(wrong), Status::kBadRequest);
  }
  EXPECT_EQ(count_, 1) << "a refused request did not run";
  EXPECT_EQ(push(Force(0, -20.5, 0)), Status::kBadRequest);
  EXPECT_EQ(dispatch_.text, "y is -20.5, but must be -20 to 20 newton");
  EXPECT_EQ(push(Force(0, 0, kNan)), Status::kBadRequest);
  EXPECT_EQ(dispatch_.text, "z is nan, but must be -20 to 20 newton");
}

TEST_F(Ranges, AreIgnoredInARequestOfAnotherType) {
  const std::array<std::byte, 3> bytes{};
  EXPECT_EQ(dispatch_.run(scene_, SceneMethodId::push, bytes), Status::kBadRequest);
  EXPECT_EQ(dispatch_.text,
            "the request of 3 bytes is not a lab.quantities.Force of 24 bytes: the schemas differ");
  EXPECT_EQ(dispatch_.run(scene_, SceneMethodId::add, bytes), Status::kBadRequest);
  EXPECT_EQ(dispatch_.text,
            "the request of 3 bytes is not a lab.quantities.Part: the schemas differ");
}

TEST_F(Ranges, AreCheckedInUnionsAndNestedTables) {
  lab::quantities::PartT part;
  part.name = "part";
  EXPECT_EQ(add(part), Status::kOk) << "what is absent is within its range";
  lab::quantities::SphereT sphere;
  sphere.radius_m = 1;
  part.shape.Set(sphere);
  EXPECT_EQ(add(part), Status::kOk);
  sphere.radius_m = 1.5;
  part.shape.Set(sphere);
  EXPECT_EQ(add(part), Status::kBadRequest);
  EXPECT_EQ(dispatch_.text, "shape.radius_m is 1.5, but must be 0.001 to 1 metre");
  part.shape.Set(Force(0, 21, 0));
  EXPECT_EQ(add(part), Status::kBadRequest);

  lab::quantities::PartT outer;
  outer.name = "outer";
  outer.parts.push_back(std::make_unique<lab::quantities::PartT>(part));
  EXPECT_EQ(add(outer), Status::kBadRequest);
  EXPECT_EQ(dispatch_.text, "parts[0].shape.y is 21, but must be -20 to 20 newton");
  outer.parts.front()->shape.Set(Force(0, 19, 0));
  EXPECT_EQ(add(outer), Status::kOk);
}

std::unique_ptr<lab::quantities::Joints> joints(float last) {
  const std::array<float, 6> angles{0, 0, 0, 0, 0, last};
  return std::make_unique<lab::quantities::Joints>(flatbuffers::span<const float, 6>(angles),
                                                   std::uint8_t{0});
}

TEST_F(Ranges, AreCheckedInNumbersArraysAndVectors) {
  lab::quantities::EverythingT everything;
  EXPECT_EQ(echo(everything), Status::kOk);
  everything.unsigned_16 = 1001;
  EXPECT_EQ(echo(everything), Status::kBadRequest);
  everything.unsigned_16 = 1000;
  everything.joints = joints(3.3F);
  EXPECT_EQ(echo(everything), Status::kBadRequest);
  EXPECT_EQ(dispatch_.text, "joints.angle[5] is 3.3, but must be -3.2 to 3.2 radian");
  everything.joints = joints(3.1F);
  EXPECT_EQ(echo(everything), Status::kOk);
  everything.forces = {Force(0, 0, 0), Force(0, 0, 100)};
  EXPECT_EQ(echo(everything), Status::kBadRequest);
  everything.forces = {Force(0, 0, 0)};
  everything.shapes.resize(2);
  everything.shapes[0].Set(Force(1, 1, 1));
  lab::quantities::SphereT sphere;
  sphere.radius_m = 0;
  everything.shapes[1].Set(sphere);
  EXPECT_EQ(echo(everything), Status::kBadRequest);
  EXPECT_EQ(dispatch_.text, "shapes[1].radius_m is 0, but must be 0.001 to 1 metre");
  everything.shapes.pop_back();
  EXPECT_EQ(echo(everything), Status::kOk);
}

}  // namespace
