#include "foxglove/requests.hpp"

#include <gtest/gtest.h>

#include <random>
#include <string>
#include <vector>

#include "rtpm/base/nesting.hpp"
#include "rtpm/test/text.hpp"

namespace rtpm::console::foxglove {
namespace {

ConstBytes bytes_of(std::string_view text) {
  return std::as_bytes(std::span(text));
}

TEST(TextRequests, AreReadAsInTheProtocol) {
  const auto subscribe = read_text(
      R"({"op":"subscribe","subscriptions":[{"id":0,"channelId":7},{"id":1,"channelId":9}]})",
      true);
  ASSERT_TRUE(subscribe) << subscribe.error();
  EXPECT_EQ(std::get<Subscribe>(*subscribe).subscriptions,
            (std::vector<Subscription>{{0, 7}, {1, 9}}));

  const auto unsubscribe =
      read_text(R"({"op":"unsubscribe","subscriptionIds":[4294967295]})", true);
  ASSERT_TRUE(unsubscribe) << unsubscribe.error();
  EXPECT_EQ(std::get<Unsubscribe>(*unsubscribe).subscription_ids,
            std::vector<std::uint32_t>{4294967295});

  const auto get = read_text(R"({"op":"getParameters","parameterNames":["a.b"],"id":"r1"})", true);
  ASSERT_TRUE(get) << get.error();
  EXPECT_EQ(std::get<GetParameters>(*get).names, std::vector<std::string>{"a.b"});
  EXPECT_EQ(std::get<GetParameters>(*get).id, "r1");

  const auto set = read_text(
      R"({"op":"setParameters","parameters":[{"name":"a.b","value":1,"type":"float64"},{"name":"c"}]})",
      true);
  ASSERT_TRUE(set) << set.error();
  const auto& parameters = std::get<SetParameters>(*set).parameters;
  ASSERT_EQ(parameters.size(), 2U);
  EXPECT_EQ(parameters[0].value, 1);
  EXPECT_EQ(parameters[0].type, "float64");
  EXPECT_TRUE(parameters[1].value.is_null());

  const auto watch = read_text(R"({"op":"subscribeParameterUpdates","parameterNames":[]})", true);
  ASSERT_TRUE(watch) << watch.error();
  EXPECT_TRUE(std::get<WatchParameters>(*watch).is_watching);
  const auto graph = read_text(R"({"op":"unsubscribeConnectionGraph"})", true);
  ASSERT_TRUE(graph) << graph.error();
  EXPECT_FALSE(std::get<WatchGraph>(*graph).is_watching);
}

TEST(TextRequests, NameAbsentCapabilities) {
  for (const std::string op : {"advertise", "unadvertise", "fetchAsset"}) {
    const auto request = read_text(R"({"op":")" + op + R"("})", true);
    ASSERT_TRUE(request) << op;
    EXPECT_EQ(std::get<Unsupported>(*request).op, op);
  }
}

TEST(TextRequests, AreRefusedIfMalformed) {
  std::string endless = R"({"op":"unsubscribe","subscriptionIds":[0)";
  for (std::size_t i = 0; i < kListSizeMax; ++i)
    endless += ",1";
  for (const std::string& text : std::vector<std::string>{
           "",
           endless + "]}",
           "{\"op\":\"\\u001b[2J\"}",
           "{",
           "[]",
           "null",
           "17",
           "{}",
           R"({"op":7})",
           R"({"op":"dance"})",
           R"({"op":"subscribe"})",
           R"({"op":"subscribe","subscriptions":{}})",
           R"({"op":"subscribe","subscriptions":[7]})",
           R"({"op":"subscribe","subscriptions":[{"id":-1,"channelId":1}]})",
           R"({"op":"subscribe","subscriptions":[{"id":1.5,"channelId":1}]})",
           R"({"op":"subscribe","subscriptions":[{"id":4294967296,"channelId":1}]})",
           R"({"op":"subscribe","subscriptions":[{"id":1}]})",
           R"({"op":"unsubscribe","subscriptionIds":["1"]})",
           R"({"op":"unsubscribe"})",
           R"({"op":"getParameters","parameterNames":[1]})",
           R"({"op":"getParameters"})",
           R"({"op":"setParameters","parameters":[{"value":1}]})",
           R"({"op":"setParameters","parameters":[1]})",
           R"({"op":"subscribeParameterUpdates","parameterNames":"all"})"}) {
    const auto request = read_text(text, true);
    ASSERT_FALSE(request) << text;
    EXPECT_FALSE(request.error().empty()) << text;
    EXPECT_EQ(request.error().find('\x1b'), std::string::npos) << text;
  }
}

std::string with_nested_value(std::size_t depth) {
  return R"({"op":"setParameters","parameters":[{"name":"a","value":)" + std::string(depth, '[') +
         std::string(depth, ']') + "}]}";
}

// 734 nested arrays once overflowed the stack of the web server's thread.
TEST(TextRequests, AreRefusedIfNestedTooDeeply) {
  constexpr std::size_t kAround = 3;
  EXPECT_TRUE(read_text(with_nested_value(kNestingMax - kAround), true));
  for (const std::size_t depth :
       {kNestingMax - kAround + 1, std::size_t{734}, std::size_t{100'000}}) {
    const auto request = read_text(with_nested_value(depth), true);
    ASSERT_FALSE(request) << depth;
    test::expect_text(request.error(), {"nests deeper than 64"});
  }
  EXPECT_FALSE(read_text("{\"op\":" + std::string(200'000, '['), true));
  const std::string whole =
      "{\"x\":" + std::string(100'000, '[') + std::string(100'000, ']') + ",\"op\":\"subscribe\"}";
  EXPECT_FALSE(read_text(whole, true));
}

TEST(TextRequests, OmitValuesForObservers) {
  const auto set = read_text(with_nested_value(8), false);
  ASSERT_TRUE(set) << set.error();
  EXPECT_EQ(std::get<SetParameters>(*set).parameters.at(0).name, "a");
  EXPECT_TRUE(std::get<SetParameters>(*set).parameters.at(0).value.is_null());
}

TEST(ServiceCalls, AreReadFromTheirBytes) {
  const std::string frame("\x02\x07\0\0\0\x2a\0\0\0\x04\0\0\0json{}", 19);
  const auto call = read_binary(bytes_of(frame));
  ASSERT_TRUE(call) << call.error();
  EXPECT_EQ(call->service_id, 7U);
  EXPECT_EQ(call->call_id, 42U);
  EXPECT_EQ(call->encoding, "json");
  EXPECT_EQ(call->payload.size(), 2U);
}

TEST(ServiceCalls, AreRefusedIfTruncated) {
  const std::string frame("\x02\x07\0\0\0\x2a\0\0\0\x04\0\0\0json", 17);
  EXPECT_TRUE(read_binary(bytes_of(frame)));
  for (std::size_t size = 0; size < frame.size(); ++size)
    EXPECT_FALSE(read_binary(bytes_of(frame.substr(0, size)))) << size;
  EXPECT_FALSE(
      read_binary(bytes_of(std::string("\x02\x07\0\0\0\x2a\0\0\0\xff\xff\xff\xffjson", 17))));
  EXPECT_FALSE(read_binary(bytes_of(std::string("\x01\0\0\0\0", 5))));
  EXPECT_FALSE(read_binary(bytes_of(std::string("\x09", 1))));
}

TEST(Requests, SurviveRandomBytes) {
  std::mt19937 random(7);
  const std::string alphabet = R"({}[]":,op subscribeIdchanelPmtr0123456789.-eE\)";
  std::size_t refused_count = 0;
  for (int i = 0; i < 20'000; ++i) {
    std::string text;
    for (std::size_t size = random() % 64; size > 0; --size)
      text += alphabet[random() % alphabet.size()];
    refused_count += read_text(text, true) ? 0U : 1U;
    std::string bytes(1, '\x02');
    for (std::size_t size = random() % 32; size > 0; --size)
      bytes += static_cast<char>(random());
    const auto call = read_binary(bytes_of(bytes));
    if (call) {
      EXPECT_LE(call->encoding.size() + call->payload.size(), bytes.size());
    }
  }
  EXPECT_EQ(refused_count, 20'000U);
}

}  // namespace
}  // namespace rtpm::console::foxglove
