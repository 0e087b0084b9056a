#include "foxglove/replies.hpp"

#include <gtest/gtest.h>

#include <array>
#include <string>

#include "foxglove/base64.hpp"
#include "foxglove/strict_json.hpp"

namespace rtpm::console::foxglove {
namespace {

using nlohmann::json;

std::string text_of(ConstBytes bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

TEST(Base64, EncodesAsInRfc4648) {
  const auto encoded = [](std::string_view text) {
    return to_base64(std::as_bytes(std::span(text)));
  };
  EXPECT_EQ(encoded(""), "");
  EXPECT_EQ(encoded("f"), "Zg==");
  EXPECT_EQ(encoded("fo"), "Zm8=");
  EXPECT_EQ(encoded("foo"), "Zm9v");
  EXPECT_EQ(encoded("foobar"), "Zm9vYmFy");
  EXPECT_EQ(encoded("\xff\xfe\xfd"), "//79");
}

TEST(BinaryReplies, HaveTheBytesOfTheProtocol) {
  EXPECT_EQ(text_of(message_head(0x01020304, 0x1122334455667788)),
            std::string("\x01\x04\x03\x02\x01\x88\x77\x66\x55\x44\x33\x22\x11", 13));
  const std::string_view payload = "{}";
  EXPECT_EQ(service_call_response(7, 42, "json", std::as_bytes(std::span(payload))),
            std::string("\x03\x07\0\0\0\x2a\0\0\0\x04\0\0\0json{}", 19));
}

TEST(TextReplies, HaveTheFieldsOfTheProtocol) {
  EXPECT_EQ(json::parse(server_info({.name = "n",
                                     .capabilities = {"services"},
                                     .encodings = {"json"},
                                     .metadata = {{"rtpm.access", "observe"}},
                                     .session_id = "s"})),
            json::parse(R"({"op":"serverInfo","name":"n","capabilities":["services"],
              "supportedEncodings":["json"],"metadata":{"rtpm.access":"observe"},"sessionId":"s"})"));
  EXPECT_EQ(json::parse(status(StatusLevel::kError, "x")),
            json::parse(R"({"op":"status","level":2,"message":"x"})"));
  const std::array channels{ChannelInfo{.id = 1, .topic = "t", .encoding = "json"},
                            ChannelInfo{2, "u", "flatbuffer", "a.B", "QQ==", "flatbuffer"}};
  EXPECT_EQ(json::parse(advertise(channels)), json::parse(R"({"op":"advertise","channels":[
              {"id":1,"topic":"t","encoding":"json","schemaName":"","schema":""},
              {"id":2,"topic":"u","encoding":"flatbuffer","schemaName":"a.B","schema":"QQ==",
               "schemaEncoding":"flatbuffer"}]})"));
  EXPECT_EQ(json::parse(advertise({})), json::parse(R"({"op":"advertise","channels":[]})"));
  const std::array<std::uint32_t, 2> ids{3, 4};
  EXPECT_EQ(json::parse(unadvertise(ids)),
            json::parse(R"({"op":"unadvertise","channelIds":[3,4]})"));
  EXPECT_EQ(json::parse(unadvertise_services(ids)),
            json::parse(R"({"op":"unadvertiseServices","serviceIds":[3,4]})"));
  EXPECT_EQ(json::parse(service_call_failure(7, 42, "no")),
            json::parse(R"({"op":"serviceCallFailure","serviceId":7,"callId":42,"message":"no"})"));
  const std::array parameters{ParameterInfo{"a.b", 0.5, "float64"}, ParameterInfo{"c", true, ""}};
  EXPECT_EQ(json::parse(parameter_values(parameters, "r1")),
            json::parse(R"({"op":"parameterValues","id":"r1","parameters":[
              {"name":"a.b","value":0.5,"type":"float64"},{"name":"c","value":true}]})"));
  EXPECT_FALSE(json::parse(parameter_values(parameters, std::nullopt)).contains("id"));
}

TEST(TextReplies, HaveSchemasForRequestAndResponse) {
  const std::array services{ServiceInfo{.id = 1,
                                        .name = "lab/arm0/read",
                                        .type = "lab/arm0/read",
                                        .request = {"flatbuffer", "a.B", "flatbuffer", "QQ=="},
                                        .response = {"json", "", "", ""}}};
  const json message = json::parse(advertise_services(services));
  EXPECT_EQ(message["services"][0]["request"]["schemaName"], "a.B");
  EXPECT_EQ(message["services"][0]["response"]["encoding"], "json");
}

TEST(StrictJson, PrintsNullForInfinityAndNan) {
  EXPECT_EQ(strict_json(R"({"low": -inf,"high": inf,"x": [nan,-nan,1e-5,-3.5],"ok": true})"),
            R"({"low": null,"high": null,"x": [null,null,1e-5,-3.5],"ok": true})");
  EXPECT_EQ(strict_json(R"({"a inf": "nan \" inf \\","b":null})"),
            R"({"a inf": "nan \" inf \\","b":null})");
  EXPECT_EQ(strict_json(""), "");
  EXPECT_EQ(strict_json("\"\\"), "\"\\");
}

TEST(TextReplies, AreJsonForAnyBytes) {
  EXPECT_TRUE(json::accept(status(StatusLevel::kInfo, "\xff\xfe \x01 \"")));
}

TEST(GraphUpdates, ContainOnlyChanges) {
  Graph before;
  before.published_topics = {{"a", {"s"}}, {"b", {"s"}}, {"c", {"s"}}};
  before.subscribed_topics = {{"b", {"browser 1"}}};
  before.services = {{"x", {"s"}}, {"y", {"s"}}};
  Graph after = before;
  after.published_topics.erase("b");
  after.published_topics.erase("c");
  after.published_topics["a"].insert("t");
  after.services.erase("y");
  EXPECT_EQ(json::parse(graph_update(before, after)), json::parse(R"({
    "op":"connectionGraphUpdate",
    "publishedTopics":[{"name":"a","publisherIds":["s","t"]},{"name":"b","publisherIds":[]},
                       {"name":"c","publisherIds":[]}],
    "subscribedTopics":[],"advertisedServices":[{"name":"y","providerIds":[]}],
    "removedTopics":["c"],"removedServices":["y"]})"));
}

}  // namespace
}  // namespace rtpm::console::foxglove
