#include <flatbuffers/flatbuffers.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "quantities.rtpm.hpp"

// Generated code with every kind of field, limits and a priority.
namespace {

namespace q = lab::quantities;
using rtpm::ConstBytes;
using rtpm::rpc::CallContext;
using rtpm::rpc::DispatchResult;
using rtpm::rpc::ReplyBuilder;
using rtpm::rpc::Result;
using rtpm::wire::Status;

/// Returns its requests.
class EchoScene final : public q::SceneServant {
 public:
  Result<q::Force> push(const q::Force& request, const CallContext&) override { return request; }
  Result<void> add(const q::Part& request, const CallContext&) override {
    added.reset(request.UnPack());
    return {};
  }
  Result<void> echo(const q::Everything& request, ReplyBuilder<q::Everything>& reply,
                    const CallContext&) override {
    const std::unique_ptr<q::EverythingT> copy(request.UnPack());
    reply.finish(q::CreateEverything(reply.builder(), copy.get()));
    return {};
  }
  Result<void> nested(const q::Outer& request, ReplyBuilder<q::Outer>& reply,
                      const CallContext&) override {
    const std::unique_ptr<q::OuterT> copy(request.UnPack());
    reply.finish(q::CreateOuter(reply.builder(), copy.get()));
    return {};
  }

  std::unique_ptr<q::PartT> added{};
};

class Quantities : public testing::Test {
 protected:
  DispatchResult call(q::SceneMethodId method, ConstBytes request) {
    EXPECT_LE(request.size(), request_.size());
    std::copy(request.begin(), request.end(), request_.begin());
    return scene_.dispatch(
        static_cast<std::uint16_t>(method), ConstBytes{request_.data(), request.size()}, reply_,
        {.priority = 0, .deadline = rtpm::kNever, .received = {}, .trace_id = 0});
  }
  template <class Table, class Object>
  DispatchResult call_table(q::SceneMethodId method, const Object& object) {
    flatbuffers::FlatBufferBuilder builder;
    builder.Finish(Table::Pack(builder, &object));
    return call(method, rtpm::rpc::table_bytes(builder));
  }

  EchoScene scene_{};
  alignas(16) std::array<std::byte, 65536> request_{};
  alignas(16) std::array<std::byte, 65536> reply_{};
};

q::EverythingT make_everything() {
  q::EverythingT all;
  all.flag = true;
  all.signed_8 = -128;
  all.unsigned_16 = 999;
  all.signed_64 = -5'000'000'000;
  all.real = 0.25F;
  all.maybe = 0;  // Present, although zero.
  all.maybe_flag = false;
  all.text = "text";
  all.bytes = {1, 2, 3};
  all.reals = {1.5, -2.5};
  all.texts = {"a", "", "c"};
  all.forces = {q::Force(1, 2, 3), q::Force(4, 5, 6)};
  const std::array<float, 6> angles{0, 0, 0, 0, 0, 2.5F};
  all.joints = std::make_unique<q::Joints>(angles, std::uint8_t{3});
  all.outer = std::make_unique<q::OuterT>();
  all.outer->inner = std::make_unique<q::InnerT>();
  all.outer->inner->text = "inner";
  all.outers.push_back(std::make_unique<q::OuterT>());
  q::SphereT sphere;
  sphere.radius_m = 0.5;
  all.shape.Set(std::move(sphere));
  all.shapes.resize(2);
  all.shapes[0].Set(q::Force(7, 8, 9));
  all.shapes[1].Set(q::PlaneT{});
  return all;
}

// The servant unpacks the request and packs it again.
TEST_F(Quantities, EveryKindOfFieldArrives) {
  flatbuffers::FlatBufferBuilder builder;
  const q::EverythingT all = make_everything();
  builder.Finish(q::Everything::Pack(builder, &all));
  const ConstBytes request = rtpm::rpc::table_bytes(builder);
  const DispatchResult result = call(q::SceneMethodId::echo, request);
  ASSERT_EQ(result.status, Status::kOk);
  const ConstBytes reply = ConstBytes(reply_).first(result.reply_size);
  ASSERT_TRUE(rtpm::rpc::is_valid_table<q::Everything>(reply));
  EXPECT_TRUE(std::ranges::equal(reply, request));
  EXPECT_EQ(flatbuffers::GetRoot<q::Everything>(reply_.data())->shapes()->GetAs<q::Force>(0)->y(),
            8);
}

TEST_F(Quantities, RequestAboveItsMaximumSizeDoesNotRun) {
  q::PartT part;
  part.name = std::string(4000, 'x');
  EXPECT_EQ(call_table<q::Part>(q::SceneMethodId::add, part).status, Status::kOk);
  ASSERT_TRUE(scene_.added);
  scene_.added.reset();
  part.name = std::string(4100, 'x');
  EXPECT_EQ(call_table<q::Part>(q::SceneMethodId::add, part).status, Status::kTooLarge);
  EXPECT_FALSE(scene_.added);
}

// 20 references of 4 bytes each in the request become 20 tables in the reply.
TEST_F(Quantities, ReplyAboveItsMaximumSizeIsTooLarge) {
  flatbuffers::FlatBufferBuilder builder;
  const auto text = builder.CreateString(std::string(200, 'x'));
  q::InnerBuilder inner(builder);
  inner.add_text(text);
  const auto shared = inner.Finish();
  const auto outer = q::CreateOuter(builder, shared, shared);
  const std::vector<flatbuffers::Offset<q::Outer>> outers(20, outer);
  const auto all = builder.CreateVector(outers);
  q::EverythingBuilder everything(builder);
  everything.add_outers(all);
  builder.Finish(everything.Finish());
  EXPECT_EQ(call(q::SceneMethodId::echo, rtpm::rpc::table_bytes(builder)).status,
            Status::kTooLarge);
}

/// A part with nested parts, `depth` deep.
std::unique_ptr<q::PartT> make_parts(int depth) {
  auto part = std::make_unique<q::PartT>();
  part->name = "p";
  if (depth > 1) part->parts.push_back(make_parts(depth - 1));
  return part;
}

TEST_F(Quantities, DepthOfARecursiveTableIsBounded) {
  EXPECT_EQ(call_table<q::Part>(q::SceneMethodId::add, *make_parts(33)).status, Status::kOk);
  EXPECT_EQ(call_table<q::Part>(q::SceneMethodId::add, *make_parts(34)).status,
            Status::kBadRequest);
}

/// A part with `count` references to one part.
flatbuffers::Offset<q::Part> share(flatbuffers::FlatBufferBuilder& builder,
                                   flatbuffers::Offset<q::Part> part, std::size_t count) {
  const auto name = builder.CreateString("p");
  const auto parts = builder.CreateVector(std::vector<flatbuffers::Offset<q::Part>>(count, part));
  q::PartBuilder next(builder);
  next.add_name(name);
  next.add_parts(parts);
  return next.Finish();
}

// A few hundred bytes whose references fan out to 10^8 visits: the time of the check is bounded by
// the bytes.
TEST_F(Quantities, SharedTablesDoNotMultiplyTheWork) {
  flatbuffers::FlatBufferBuilder builder;
  auto part = share(builder, 0, 0);
  for (int level = 0; level < 8; ++level)
    part = share(builder, part, 10);
  builder.Finish(part);
  EXPECT_LT(builder.GetSize(), 2000u);
  EXPECT_EQ(call(q::SceneMethodId::add, rtpm::rpc::table_bytes(builder)).status,
            Status::kBadRequest);

  // Sharing one table is accepted.
  builder.Clear();
  builder.Finish(share(builder, share(builder, 0, 0), 100));
  EXPECT_EQ(call(q::SceneMethodId::add, rtpm::rpc::table_bytes(builder)).status, Status::kOk);
}

}  // namespace
