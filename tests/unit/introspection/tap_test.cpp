#include <gtest/gtest.h>

#include <chrono>
#include <optional>
#include <string>
#include <vector>

#include "room.hpp"
#include "rtpm/rpc/node.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/test/os.hpp"
#include "rtpm/test/text.hpp"

// The tap of a server's calls, read by another program.
namespace rtpm::introspection::test {
namespace {

constexpr Duration kPatience = std::chrono::seconds{20};
using rtpm::test::await;
using Stream = rpc::TableStream<TapBatch>;

class TapOfARoom : public testing::Test {
 protected:
  /// The stream after its first item, which is stored in `first`.
  std::optional<Stream> open(const TapRequestT& request) {
    auto stream = tap_.tap(request);
    EXPECT_TRUE(stream);
    const auto item = stream->next(rt::now() + kPatience);
    EXPECT_TRUE(item && *item != nullptr);
    if (!item || *item == nullptr) return std::nullopt;
    (*item)->UnPackTo(&first_);
    return std::move(*stream);
  }
  /// The next item with calls.
  TapBatchT read(Stream& stream) {
    TapBatchT batch;
    while (batch.calls.empty()) {
      const auto item = stream.next(rt::now() + kPatience);
      EXPECT_TRUE(item && *item != nullptr);
      if (!item || *item == nullptr) break;
      batch = {};
      (*item)->UnPackTo(&batch);
    }
    return batch;
  }
  static TapRequestT request_for(const std::string& path, std::vector<std::uint16_t> methods = {}) {
    TapRequestT request;
    request.objects.push_back(std::make_unique<TappedObjectT>());
    request.objects.back()->path = path;
    request.objects.back()->methods = std::move(methods);
    return request;
  }

  Room room_{};
  rpc::Node node_{{.default_deadline = kPatience, .collocates = false}};
  room::LightClient light_ = std::move(*room::LightClient::bind(node_, room_.url("room/light")));
  TapClient tap_ = std::move(*TapClient::bind(node_, room_.url(kTapPath)));
  TapBatchT first_{};
};

TEST_F(TapOfARoom, StreamsCallsWithTheirPayloads) {
  auto stream = open({});
  ASSERT_TRUE(stream);
  EXPECT_EQ(first_.objects,
            (std::vector<std::string>{"room/light", "rtpm/introspection", "rtpm/tap"}));
  const room::Colour colour(0.5F, 0.25F, 0.125F);
  ASSERT_TRUE(light_.set(colour, {.priority = 12, .trace_id = 34}));
  const TapBatchT batch = read(*stream);
  ASSERT_EQ(batch.calls.size(), 1U);
  const TappedCall& call = batch.calls.front();
  EXPECT_EQ(call.object(), 0U);
  EXPECT_EQ(call.method(), 1U);
  EXPECT_EQ(call.priority(), 12U);
  EXPECT_EQ(call.trace_id(), 34U);
  EXPECT_EQ(call.stage(), TapStage::Whole);
  EXPECT_EQ(call.status(), CallStatus::ok);
  EXPECT_EQ(call.request_size(), sizeof colour);
  EXPECT_EQ(call.reply_size(), 0U);
  ASSERT_EQ(batch.payloads.size(), sizeof colour);
  EXPECT_EQ(std::memcmp(batch.payloads.data(), &colour, sizeof colour), 0);
  EXPECT_EQ(batch.dropped_count, 0U);
}

TEST_F(TapOfARoom, StreamsOnlyRequestedMethods) {
  auto stream = open(request_for("room/light", {2}));
  ASSERT_TRUE(stream);
  ASSERT_TRUE(light_.set({1, 1, 1}));
  ASSERT_TRUE(light_.get());
  const TapBatchT batch = read(*stream);
  ASSERT_EQ(batch.calls.size(), 1U);
  EXPECT_EQ(batch.calls.front().method(), 2U);
}

TEST_F(TapOfARoom, OmitsPayloadsAboveTheLimit) {
  TapRequestT request;
  request.payload_byte_max = 4;
  auto stream = open(request);
  ASSERT_TRUE(stream);
  ASSERT_TRUE(light_.set({1, 1, 1}));
  const TapBatchT batch = read(*stream);
  ASSERT_EQ(batch.calls.size(), 1U);
  EXPECT_FALSE(batch.calls.front().has_request());
  EXPECT_TRUE(batch.payloads.empty());
  EXPECT_EQ(batch.omitted_payload_count, 1U);
}

TEST_F(TapOfARoom, ServesOneClientAtATime) {
  auto stream = open({});
  ASSERT_TRUE(stream);
  const auto refused = open({});
  ASSERT_TRUE(refused);
  rtpm::test::expect_text(first_.refusal, {"tapped already"});
  EXPECT_TRUE(room_.server->tap()->is_on());
  // Once its client has gone, the tap is off again, and free for the next client.
  stream->cancel();
  EXPECT_TRUE(await([&] { return !room_.server->tap()->is_on(); }));
  EXPECT_TRUE(await([&] {
    first_ = {};
    static_cast<void>(open({}));
    return first_.refusal.empty();
  }));
}

TEST_F(TapOfARoom, RefusesUnknownObjects) {
  static_cast<void>(open(request_for("room/lihgt")));
  rtpm::test::expect_text(first_.refusal, {"no object 'room/lihgt'"});
  EXPECT_FALSE(room_.server->tap()->is_on());
}

TEST_F(TapOfARoom, EndsWithItsServer) {
  auto stream = open({});
  ASSERT_TRUE(stream);
  room_.server->stop();
  while (true) {
    const auto item = stream->next(rt::now() + kPatience);
    if (item && *item != nullptr) continue;
    if (!item) {
      EXPECT_NE(item.error(), rpc::CallError::kTimeout);
    }
    break;
  }
  EXPECT_FALSE(room_.server->tap()->is_on());
}

// Both enumerations have the wire's numbers.
TEST(CallStatuses, HaveTheNamesOfTheWire) {
  for (std::uint16_t number = 0; number < wire::kStatusCount; ++number) {
    std::string name(to_string(static_cast<wire::Status>(number)));
    for (char& letter : name) {
      if (letter == '-' || letter == ' ') letter = '_';
    }
    EXPECT_EQ(EnumNameCallStatus(static_cast<CallStatus>(number)), name);
  }
}

}  // namespace
}  // namespace rtpm::introspection::test
