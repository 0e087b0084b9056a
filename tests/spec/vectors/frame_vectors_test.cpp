#include <gtest/gtest.h>

#include <array>
#include <fstream>
#include <map>
#include <regex>

#include "rtpm/wire/client_channel.hpp"
#include "rtpm/wire/server_sessions.hpp"
#include "vectors.hpp"

// spec/vectors/headers-*.json and constants.json.
namespace rtpm::spec {
namespace {

using wire::Medium;

wire::Header header_of(const Json& vector) {
  const Json& shown = vector.at("header");
  wire::Header header;
  header.kind = kind_named(shown.at("kind"));
  header.priority = shown.at("priority").get<int>();
  for (const auto& [name, flag] : {std::pair{"is_repeated", wire::kFlagRepeated},
                                   {"is_ack_wanted", wire::kFlagAckWanted},
                                   {"is_no_reply", wire::kFlagNoReply},
                                   {"is_reply_on_receipt", wire::kFlagReplyOnReceipt}}) {
    if (shown.at(name).get<bool>()) header.flags |= flag;
  }
  header.session = wide_number(shown.at("session"));
  header.call_id = shown.at("call_id");
  header.service = shown.at("service");
  header.method = shown.at("method");
  header.status = status_named(shown.at("status"));
  const std::size_t payload_size = vector.at("payload").get<std::string>().size() / 2;
  header.payload_size = static_cast<std::uint32_t>(payload_size);
  header.fragment_index = shown.at("fragment_index");
  header.fragment_count = shown.at("fragment_count");
  header.message_size = shown.at("message_size");
  header.budget_us = shown.at("budget_us");
  header.item = shown.at("item");
  header.sender_time_ns = wide_number(shown.at("sender_time_ns"));
  header.trace_id = wide_number(shown.at("trace_id"));
  return header;
}

TEST(HeaderVectors, GoodOnesAreDecoded) {
  const Json document = read_vectors("headers-good.json");
  EXPECT_FALSE(document.at("vectors").empty());
  for (const Json& vector : document.at("vectors")) {
    SCOPED_TRACE(vector.at("name"));
    const Bytes frame = bytes_of_hex(vector.at("hex"));
    const auto header = wire::decode_frame(frame);
    ASSERT_TRUE(header) << to_string(header.error());
    EXPECT_EQ(hex_of(ConstBytes(frame).subspan(wire::kHeaderSize)), vector.at("payload"));
    // Encoding gives each byte of a header one meaning, so equal bytes are equal fields.
    Bytes shown(wire::kHeaderSize);
    encode(header_of(vector), shown.data());
    EXPECT_EQ(hex_of(shown), hex_of(ConstBytes(frame).first(wire::kHeaderSize)));
    Bytes read(wire::kHeaderSize);
    encode(*header, read.data());
    EXPECT_EQ(hex_of(read), hex_of(shown));
  }
}

/// The reaction of a side to a frame that it has to drop.
struct Outcome {
  std::string dropped_as;
  bool is_answered = false;
  bool is_stream_ended = false;
};

Outcome at_a_server(const Bytes& frame, Medium medium) {
  wire::ServerSessionsConfig config;
  config.medium = medium;
  config.epoch = 1;
  wire::ServerSessions server(config);
  const wire::Verdict verdict = server.on_frame(frame, {}, time_from_ns(1));
  return {newly_dropped({}, server.counters()),
          verdict.action == wire::Verdict::Action::kSend ||
              verdict.action == wire::Verdict::Action::kDispatch,
          verdict.action == wire::Verdict::Action::kHangUp};
}

Outcome at_a_client(const Bytes& frame, Medium medium) {
  std::array<std::byte, 128> buffer{};
  wire::ClientChannel client({.medium = medium, .client_epoch = 1}, buffer);
  const wire::ChannelEvent event = client.on_frame(frame, time_from_ns(1));
  return {newly_dropped({}, client.counters()),
          event.kind != wire::ChannelEvent::Kind::kNothing &&
              event.kind != wire::ChannelEvent::Kind::kBroken,
          event.kind == wire::ChannelEvent::Kind::kBroken};
}

// hp-8-1: the frame counts under this reason only, at both sides unless the vector names one.
TEST(HeaderVectors, BadOnesAreDroppedForTheirReason) {
  const Json document = read_vectors("headers-bad.json");
  EXPECT_FALSE(document.at("vectors").empty());
  for (const Json& vector : document.at("vectors")) {
    const Bytes frame = bytes_of_hex(vector.at("hex"));
    for (const std::string side : {"server", "client"}) {
      if (vector.at("receiver") != "any" && vector.at("receiver") != side) continue;
      for (const std::string medium : vector.at("medium")) {
        SCOPED_TRACE(vector.at("name").get<std::string>() + " at a " + side + " of a " + medium);
        const Outcome outcome = side == "server" ? at_a_server(frame, medium_named(medium))
                                                 : at_a_client(frame, medium_named(medium));
        EXPECT_EQ(outcome.dropped_as, vector.at("drop"));
        EXPECT_FALSE(outcome.is_answered);
        EXPECT_EQ(outcome.is_stream_ended, medium == "stream" && vector.at("ends_stream"));
      }
    }
  }
}

template <class T>
void expect_names(const Json& numbers, std::size_t count) {
  EXPECT_EQ(numbers.size(), count);
  for (const auto& [name, number] : numbers.items()) {
    EXPECT_EQ(to_string(static_cast<T>(number.template get<int>())), name);
  }
}

TEST(Constants, MatchTheCode) {
  const Json constants = read_vectors("constants.json");
  EXPECT_EQ(constants.at("version"), wire::kVersion);
  EXPECT_EQ(constants.at("header_size"), wire::kHeaderSize);
  expect_names<wire::FrameKind>(constants.at("kinds"), wire::kFrameKindLast);
  expect_names<wire::Status>(constants.at("statuses"), wire::kStatusCount);
  EXPECT_EQ(constants.at("flags"), (Json{{"repeated", wire::kFlagRepeated},
                                         {"ack_wanted", wire::kFlagAckWanted},
                                         {"no_reply", wire::kFlagNoReply},
                                         {"reply_on_receipt", wire::kFlagReplyOnReceipt}}));
  EXPECT_EQ(constants.at("session_service"), wire::kSessionService);
  EXPECT_EQ(constants.at("method_bind"), wire::kMethodBind);
  EXPECT_EQ(constants.at("method_ping"), wire::kMethodPing);
  EXPECT_EQ(constants.at("method_describe"), wire::kMethodDescribe);

  const auto us = [](Duration duration) { return duration.count() / 1000; };
  const Json expected{{"datagram_frame_size_max", wire::kDatagramFrameSizeMax},
                      {"datagram_payload_size_max", wire::kDatagramPayloadSizeMax},
                      {"stream_frame_size_max", wire::kStreamFrameSizeMax},
                      {"stream_payload_size_max", wire::kStreamPayloadSizeMax},
                      {"fragment_window", wire::kFragmentWindow},
                      {"stream_fragment_window", wire::kStreamFragmentWindow},
                      {"fragment_count_max", wire::kFragmentCountMax},
                      {"stream_window", wire::kStreamWindow},
                      {"stream_lease_max_ms", us(wire::kStreamLeaseMax) / 1000},
                      {"stream_silence_ms", us(wire::kStreamSilence) / 1000},
                      {"stream_bytes_first_datagram", wire::kStreamBytesFirstDatagram},
                      {"stream_bytes_first_stream", wire::kStreamBytesFirstStream},
                      {"stream_ask_interval_max_ms", us(wire::kStreamAskIntervalMax) / 1000},
                      {"message_size_floor", wire::kMessageSizeFloor},
                      {"message_size_ceiling", wire::kMessageSizeCeiling},
                      {"call_window", wire::kCallWindow},
                      {"session_idle_min_s", us(wire::kSessionIdleMin) / 1'000'000},
                      {"cookie_span_s", us(wire::kCookieSpan) / 1'000'000},
                      {"path_size_max", wire::kPathSizeMax},
                      {"copy_interval_first_us", us(wire::kRetransmitIntervalFirst)},
                      {"copy_interval_min_us", us(wire::kRetransmitIntervalMin)},
                      {"copy_interval_max_us", us(wire::kRetransmitIntervalMax)}};
  EXPECT_EQ(constants.at("limits"), expected);
}

/// The first two cells of each row of the tables in the page's section `anchor`, as name and
/// number.
std::map<std::string, int> numbers_on_the_page(const std::string& anchor) {
  static const std::regex kRow(R"(^\| ([0-9]+) \| (\w+) \|.*)");
  std::ifstream page(RTPM_SPEC_DIR "/hprotocol.md");
  std::map<std::string, int> numbers;
  bool is_inside = false;
  for (std::string line; std::getline(page, line);) {
    std::smatch cells;
    if (line.starts_with("#")) is_inside = line.ends_with("{#" + anchor + "}");
    if (is_inside && std::regex_match(line, cells, kRow)) numbers[cells[2]] = std::stoi(cells[1]);
  }
  return numbers;
}

TEST(Constants, MatchThePage) {
  const Json constants = read_vectors("constants.json");
  EXPECT_EQ(Json(numbers_on_the_page("hp-3")), constants.at("kinds"));
  EXPECT_EQ(Json(numbers_on_the_page("hp-7")), constants.at("statuses"));
}

}  // namespace
}  // namespace rtpm::spec
