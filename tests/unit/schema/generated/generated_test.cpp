#include <flatbuffers/flatbuffers.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstring>
#include <string>
#include <string_view>

#include "arm.rtpm.hpp"
#include "global.rtpm.hpp"
#include "nothing_own.rtpm.hpp"
#include "shared.rtpm.hpp"
#include "types_only.rtpm.hpp"

// Generated skeletons: the test passes requests to dispatch() as a lane does.
namespace {

using rtpm::ConstBytes;
using rtpm::rpc::CallContext;
using rtpm::rpc::DispatchResult;
using rtpm::rpc::Refusal;
using rtpm::rpc::ReplyBuilder;
using rtpm::rpc::Result;
using rtpm::wire::Status;

/// An arm that records requests and returns recognisable values.
class TestArm final : public lab::ArmServant {
 public:
  Result<void> release(const CallContext&) override { return note("release"); }
  Result<lab::Position> get_position(const CallContext& context) override {
    trace_id = context.trace_id;
    ran = "get_position";
    return lab::Position{1, 2, 3};
  }
  Result<void> last_recording(ReplyBuilder<lab::Recording>& reply, const CallContext&) override {
    return answer("last", reply);
  }
  Result<void> set_force(const lab::Force& request, const CallContext&) override {
    if (refusal) return rtpm::unexpected{*refusal};
    force = request;
    return note("set_force");
  }
  Result<lab::Position> exchange(const lab::Force& request, const CallContext&) override {
    if (refusal) return rtpm::unexpected{*refusal};
    ran = "exchange";
    return lab::Position{request.x_newton() * 2, request.y_newton() * 2, request.z_newton() * 2};
  }
  Result<void> try_out(const lab::Force& request, ReplyBuilder<lab::Recording>& reply,
                       const CallContext&) override {
    force = request;
    return answer("tried", reply);
  }
  Result<void> record(const lab::RecordRequest& request, const CallContext&) override {
    title = request.title() ? request.title()->str() : "";
    mode = request.mode();
    return note("record");
  }
  Result<lab::Position> go_to_start(const lab::RecordRequest& request,
                                    const CallContext&) override {
    if (request.start() == nullptr) return rtpm::unexpected{Refusal::kBadRequest};
    ran = "go_to_start";
    return *request.start();
  }
  Result<void> replay(const lab::RecordRequest& request, ReplyBuilder<lab::Recording>& reply,
                      const CallContext&) override {
    if (refusal) return rtpm::unexpected{*refusal};
    if (!is_answering) return {};
    return answer(request.title()->str(), reply);
  }
  Result<void> delete_(const CallContext&) override { return note("delete"); }
  Result<void> interface_(const CallContext&) override { return note("interface"); }
  Result<void> dispatch_(const lab::RecordRequest&, const CallContext&) override {
    return note("dispatch");
  }
  Result<void> binding_(const CallContext&) override { return note("binding"); }
  Result<void> bind(const lab::RecordRequest&, const CallContext&) override { return note("bind"); }
  Result<void> request(const lab::Force&, const CallContext&) override { return note("request"); }
  Result<void> reply(ReplyBuilder<lab::Recording>& builder, const CallContext&) override {
    return answer("reply", builder);
  }
  Result<void> context(const CallContext&) override { return note("context"); }
  Result<void> std(const CallContext&) override { return note("std"); }
  Result<void> rtpm(const CallContext&) override { return note("rtpm"); }
  Result<void> lab(const ::lab::Force&, const CallContext&) override { return note("lab"); }

  ::std::string ran{};
  ::std::string title{};
  ::lab::Mode mode{};
  ::lab::Force force{};
  ::std::uint64_t trace_id = 0;
  ::std::optional<Refusal> refusal{};
  bool is_answering = true;
  std::size_t answer_size = 0;

 private:
  Result<void> note(::std::string_view name) {
    ran = name;
    return {};
  }
  Result<void> answer(const ::std::string& text, ReplyBuilder<::lab::Recording>& reply) {
    const ::std::string padded = text + ::std::string(answer_size, '.');
    auto& builder = reply.builder();
    reply.finish(::lab::CreateRecording(builder, builder.CreateString(padded)));
    return note(text);
  }
};

/// A servant with the buffers that a lane provides.
class Generated : public testing::Test {
 protected:
  DispatchResult call(lab::ArmMethodId method, ConstBytes request = {}) {
    std::copy(request.begin(), request.end(), request_.begin());
    return arm_.dispatch(static_cast<std::uint16_t>(method),
                         ConstBytes{request_.data(), request.size()}, reply_, context());
  }
  DispatchResult call(lab::ArmMethodId method, const lab::RecordRequestT& request) {
    flatbuffers::FlatBufferBuilder builder;
    builder.Finish(lab::RecordRequest::Pack(builder, &request));
    return call(method, rtpm::rpc::table_bytes(builder));
  }
  static CallContext context() {
    return {.priority = 0, .deadline = rtpm::kNever, .received = {}, .trace_id = 77};
  }
  lab::Position position() const {
    lab::Position value;
    std::memcpy(&value, reply_.data(), sizeof value);
    return value;
  }
  const lab::Recording& recording(const DispatchResult& result) const {
    EXPECT_TRUE(rtpm::rpc::is_valid_table<lab::Recording>({reply_.data(), result.reply_size}));
    return *flatbuffers::GetRoot<lab::Recording>(reply_.data());
  }

  TestArm arm_;
  lab::Force force_{0.5, -1, 2};
  alignas(16) std::array<std::byte, 512> request_{};
  alignas(16) std::array<std::byte, 512> reply_{};
};

lab::RecordRequestT make_request(const std::string& title) {
  lab::RecordRequestT request;
  request.title = title;
  return request;
}

TEST_F(Generated, RunsEachKindOfRequestAndReply) {
  using Id = lab::ArmMethodId;
  const ConstBytes force = rtpm::rpc::struct_bytes(force_);
  DispatchResult result = call(Id::release);
  EXPECT_EQ(result.status, Status::kOk);
  EXPECT_EQ(result.reply_size, 0u);
  EXPECT_EQ(arm_.ran, "release");
  result = call(Id::get_position);
  EXPECT_EQ(result.status, Status::kOk);
  EXPECT_EQ(result.reply_size, 24u) << "the bare struct";
  EXPECT_EQ(position().z_m(), 3);
  EXPECT_EQ(arm_.trace_id, 77u);
  EXPECT_EQ(recording(call(Id::last_recording)).title()->str(), "last");

  result = call(Id::set_force, force);
  EXPECT_EQ(result.status, Status::kOk);
  EXPECT_EQ(result.reply_size, 0u);
  EXPECT_EQ(arm_.force.y_newton(), -1);
  EXPECT_EQ(call(Id::exchange, force).status, Status::kOk);
  EXPECT_EQ(position().z_m(), 4);
  EXPECT_EQ(recording(call(Id::try_out, force)).title()->str(), "tried");

  EXPECT_EQ(call(Id::record, make_request("take 1")).status, Status::kOk);
  EXPECT_EQ(arm_.title, "take 1");
  EXPECT_EQ(arm_.mode, lab::Mode::Hold);
  lab::RecordRequestT start = make_request("");
  start.start = std::make_unique<lab::Position>(7, 8, 9);
  EXPECT_EQ(call(Id::go_to_start, start).status, Status::kOk);
  EXPECT_EQ(position().y_m(), 8);
  EXPECT_EQ(recording(call(Id::replay, make_request("again"))).title()->str(), "again");
}

TEST_F(Generated, MethodsWithNamesTakenInCppRun) {
  const std::pair<lab::ArmMethodId, const char*> empty[] = {
      {lab::ArmMethodId::delete_, "delete"},   {lab::ArmMethodId::interface_, "interface"},
      {lab::ArmMethodId::binding_, "binding"}, {lab::ArmMethodId::context, "context"},
      {lab::ArmMethodId::std, "std"},          {lab::ArmMethodId::rtpm, "rtpm"},
      {lab::ArmMethodId::reply, "reply"},
  };
  for (const auto& [method, name] : empty) {
    EXPECT_EQ(call(method).status, Status::kOk);
    EXPECT_EQ(arm_.ran, name);
  }
  EXPECT_EQ(call(lab::ArmMethodId::lab, rtpm::rpc::struct_bytes(force_)).status, Status::kOk);
  EXPECT_EQ(arm_.ran, "lab");
  EXPECT_EQ(call(lab::ArmMethodId::dispatch_, make_request("x")).status, Status::kOk);
  EXPECT_EQ(arm_.ran, "dispatch");
}

TEST_F(Generated, UnknownMethodIsRefused) {
  for (const int id : {0, 10, 100, 111, 65534}) {
    const DispatchResult result = call(static_cast<lab::ArmMethodId>(id));
    EXPECT_EQ(result.status, Status::kNoSuchMethod) << id;
    EXPECT_EQ(result.reply_size, 0u);
  }
  EXPECT_EQ(arm_.ran, "");
}

TEST_F(Generated, MalformedRequestDoesNotRun) {
  const std::array<std::byte, 25> bytes{};
  for (const std::size_t size : {0u, 1u, 23u, 25u}) {
    EXPECT_EQ(call(lab::ArmMethodId::set_force, {bytes.data(), size}).status, Status::kBadRequest);
  }
  EXPECT_EQ(call(lab::ArmMethodId::release, {bytes.data(), 1}).status, Status::kBadRequest);
  EXPECT_EQ(call(lab::ArmMethodId::get_position, {bytes.data(), 16}).status, Status::kBadRequest);
  std::array<std::byte, 32> garbage;
  garbage.fill(std::byte{0xEE});
  for (const std::size_t size : {0u, 3u, 4u, 32u}) {
    EXPECT_EQ(call(lab::ArmMethodId::record, {garbage.data(), size}).status, Status::kBadRequest);
  }
  EXPECT_EQ(arm_.ran, "");
}

TEST_F(Generated, RefusalsAndUnfinishedRepliesHaveTheirStatus) {
  const std::pair<Refusal, Status> refusals[] = {
      {Refusal::kOverload, Status::kOverload},
      {Refusal::kBadRequest, Status::kBadRequest},
      {Refusal::kNotLeaseHolder, Status::kNotLeaseHolder},
      {Refusal::kGone, Status::kGone},
      {Refusal::kFailed, Status::kServantFailed}};
  for (const auto& [refusal, status] : refusals) {
    arm_.refusal = refusal;
    EXPECT_EQ(call(lab::ArmMethodId::set_force, rtpm::rpc::struct_bytes(force_)).status, status);
    EXPECT_EQ(call(lab::ArmMethodId::exchange, rtpm::rpc::struct_bytes(force_)).status, status);
    const DispatchResult result = call(lab::ArmMethodId::replay, make_request("x"));
    EXPECT_EQ(result.status, status);
    EXPECT_EQ(result.reply_size, 0u);
  }
  arm_.refusal.reset();
  arm_.is_answering = false;
  EXPECT_EQ(call(lab::ArmMethodId::replay, make_request("x")).status, Status::kServantFailed);
}

TEST_F(Generated, TooLargeReplyIsReported) {
  arm_.answer_size = 4096;
  EXPECT_EQ(call(lab::ArmMethodId::last_recording).status, Status::kTooLarge);
  alignas(16) std::array<std::byte, 16> small{};
  EXPECT_EQ(arm_.dispatch(2, {}, small, context()).status, Status::kTooLarge);
}

}  // namespace
