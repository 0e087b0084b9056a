#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <regex>

#include "capture.hpp"
#include "rtpm/wire/sealed.hpp"
#include "talk.hpp"
#include "vectors.hpp"

// spec/wireshark/hprotocol.lua, run by tshark over captures of our code and of the vectors.
namespace rtpm::spec {
namespace {

using namespace std::chrono_literals;

class Dissector : public DissectorTest {};

Bytes bind_reply() {
  Bytes bytes(wire::BindReply::kSize + wire::MethodEntry::kSize);
  encode(wire::BindReply{.service = 7, .fingerprint = 0x1234, .method_count = 1}, bytes);
  encode(wire::MethodEntry{2, 0x22}, MutableBytes(bytes).subspan(wire::BindReply::kSize));
  return bytes;
}

std::string hex_number(std::uint64_t value) {
  std::array<std::byte, 8> bytes{};
  for (std::size_t i = 0; i < bytes.size(); ++i)
    bytes[i] = static_cast<std::byte>(value >> (56 - 8 * i));
  return "0x" + hex_of(bytes);
}

/// Each row's value of a field, in order.
std::vector<std::string> column(const std::vector<Row>& rows, const std::string& field) {
  std::vector<std::string> values;
  for (const Row& row : rows)
    values.push_back(row.at(field));
  return values;
}

/// HELLO, COOKIE, HELLO, WELCOME; bind and its reply; a call that is lost, repeated, answered, and
/// answered again to a duplicate; a call that expired.
void talk_over_udp(Talk& talk) {
  talk.open(0us);
  talk.exchange(0, wire::kMethodBind, bind_request(), bind_reply(), 1ms);
  const Bytes request(48, std::byte{0xab});
  static_cast<void>(talk.call(7, 2, request, 10ms));
  const wire::Verdict verdict = talk.to_server(talk.repeat(15ms), 15ms + 100us);
  const Bytes reply = talk.complete(verdict, {}, 15ms + 600us);
  talk.sent_by_server(reply, 15ms + 700us);
  talk.to_client(reply, 15ms + 700us);
  const Bytes late = talk.call(7, 2, {}, 30ms, 0ms);
  const Bytes expired = Talk::copy_of(talk.to_server(late, 30ms + 100us).frame);
  talk.sent_by_server(expired, 30ms + 200us);
  talk.to_client(expired, 30ms + 200us);
}

TEST_F(Dissector, ReadsAConversationOverUdp) {
  // The traffic is on its own port, and on another port, where its content identifies it.
  for (const std::uint16_t port : {kDefaultPort, std::uint16_t{4242}}) {
    SCOPED_TRACE("port " + std::to_string(port));
    Talk talk(wire::Medium::kDatagram, port);
    talk_over_udp(talk);
    const auto rows = dissect(
        talk.capture,
        {"_ws.col.Protocol",    "rtpm.kind",          "rtpm.priority",  "rtpm.flags",
         "rtpm.session",        "rtpm.call_id",       "rtpm.service",   "rtpm.method",
         "rtpm.status",         "rtpm.payload_size",  "rtpm.budget_us", "rtpm.trace_id",
         "rtpm.request_in",     "rtpm.reply_in",      "rtpm.copy_of",   "rtpm.time",
         "rtpm.server_us",      "rtpm.object",        "rtpm.drop",      "rtpm.expert.repeated",
         "rtpm.expert.expired", "rtpm.sender_time_ns"});
    ASSERT_EQ(rows.size(), 11u);
    EXPECT_EQ(column(rows, "_ws.col.Protocol"), Column(11, "RTPM"));
    EXPECT_EQ(column(rows, "rtpm.kind"),
              (Column{"1", "2", "1", "3", "5", "6", "5", "5", "6", "5", "6"}));
    EXPECT_EQ(column(rows, "rtpm.priority"), Column(11, "24000"));
    EXPECT_EQ(rows[7].at("rtpm.flags"), "0x0001");
    EXPECT_EQ(rows[6].at("rtpm.flags"), "0x0000");
    EXPECT_EQ(rows[6].at("rtpm.session"), hex_number(talk.session()));
    EXPECT_EQ(column(rows, "rtpm.call_id"),
              (Column{"1", "1", "1", "1", "1", "1", "2", "2", "2", "3", "3"}));
    EXPECT_EQ(column(rows, "rtpm.service"),
              (Column{"0", "0", "0", "0", "0", "0", "7", "7", "7", "7", "7"}));
    EXPECT_EQ(rows[8].at("rtpm.method"), "2");
    EXPECT_EQ(column(rows, "rtpm.status"),
              (Column{"0", "0", "0", "0", "0", "0", "0", "0", "0", "0", "2"}));
    EXPECT_EQ(rows[6].at("rtpm.payload_size"), "48");
    EXPECT_EQ(rows[6].at("rtpm.budget_us"), "20000");
    EXPECT_EQ(rows[7].at("rtpm.budget_us"), "15000");
    EXPECT_EQ(rows[6].at("rtpm.trace_id"), "0x0000000000007ace");
    EXPECT_EQ(rows[6].at("rtpm.sender_time_ns"), "1010000000");
    EXPECT_EQ(column(rows, "rtpm.request_in"),
              (Column{"", "1", "", "3", "", "5", "", "", "7", "", "10"}));
    EXPECT_EQ(column(rows, "rtpm.reply_in"),
              (Column{"2", "", "4", "", "6", "", "9", "9", "", "11", ""}));
    EXPECT_EQ(column(rows, "rtpm.copy_of"), (Column{"", "", "", "", "", "", "", "7", "", "", ""}));
    EXPECT_EQ(rows[5].at("rtpm.time"), "0.000300000");
    EXPECT_EQ(rows[5].at("rtpm.server_us"), "200");
    EXPECT_EQ(rows[8].at("rtpm.time"), "0.005700000") << "since the first copy";
    EXPECT_EQ(rows[8].at("rtpm.server_us"), "500");
    EXPECT_EQ(column(rows, "rtpm.object"), (Column{"", "", "", "", "", "", "lab/arm0", "lab/arm0",
                                                   "lab/arm0", "lab/arm0", "lab/arm0"}));
    EXPECT_EQ(column(rows, "rtpm.drop"), Column(11, ""));
    EXPECT_NE(rows[7].at("rtpm.expert.repeated"), "");
    EXPECT_EQ(rows[6].at("rtpm.expert.repeated"), "");
    EXPECT_NE(rows[10].at("rtpm.expert.expired"), "");
    EXPECT_EQ(rows[8].at("rtpm.expert.expired"), "");
  }
}

TEST_F(Dissector, ReadsThePayloadsOfTheSession) {
  Talk talk(wire::Medium::kDatagram, kDefaultPort);
  talk_over_udp(talk);
  const auto rows = dissect(
      talk.capture, {"rtpm.hello.client_epoch", "rtpm.hello.channel", "rtpm.hello.message_size_max",
                     "rtpm.hello.cookie", "rtpm.cookie.cookie", "rtpm.welcome.band_high",
                     "rtpm.welcome.window", "rtpm.welcome.server_epoch", "rtpm.bind.path",
                     "rtpm.bind.interface", "rtpm.bind.fingerprint", "rtpm.bind.service",
                     "rtpm.bind.method.id", "rtpm.bind.method.fingerprint", "rtpm.payload"});
  ASSERT_EQ(rows.size(), 11u);
  EXPECT_EQ(rows[0].at("rtpm.hello.client_epoch"), "0x0000000000c11e47");
  EXPECT_EQ(rows[0].at("rtpm.hello.channel"), "0x0000000000000003");
  EXPECT_EQ(rows[0].at("rtpm.hello.message_size_max"), "4000");
  EXPECT_EQ(rows[0].at("rtpm.hello.cookie"), std::string(32, '0'));
  EXPECT_EQ(rows[1].at("rtpm.cookie.cookie").size(), 32u);
  EXPECT_EQ(rows[2].at("rtpm.hello.cookie"), rows[1].at("rtpm.cookie.cookie"));
  EXPECT_EQ(rows[3].at("rtpm.welcome.band_high"), "32767");
  EXPECT_EQ(rows[3].at("rtpm.welcome.window"), "8");
  EXPECT_EQ(rows[3].at("rtpm.welcome.server_epoch"), "0x0000000000005e12");
  EXPECT_EQ(rows[4].at("rtpm.bind.path"), "lab/arm0");
  EXPECT_EQ(rows[4].at("rtpm.bind.interface"), "lab.Arm");
  EXPECT_EQ(rows[4].at("rtpm.bind.fingerprint"), "0x0000000000001234");
  EXPECT_EQ(rows[5].at("rtpm.bind.service"), "7");
  EXPECT_EQ(rows[5].at("rtpm.bind.method.id"), "2");
  EXPECT_EQ(rows[5].at("rtpm.bind.method.fingerprint"), "0x00000022");
  EXPECT_EQ(rows[6].at("rtpm.payload"), hex_of(Bytes(48, std::byte{0xab})));
}

TEST_F(Dissector, ReassemblesFramesOfAStream) {
  for (const std::uint16_t port : {kDefaultPort, std::uint16_t{4242}}) {
    SCOPED_TRACE("port " + std::to_string(port));
    Talk talk(wire::Medium::kStream, port);
    talk.open(0us);
    // One call spans three segments, the first of which ends within the header.
    Talk unsent(wire::Medium::kStream, port);
    unsent.open(0us);
    const Bytes call = unsent.call(7, 2, Bytes(1500, std::byte{1}), 1ms);
    talk.segment_by_client(ConstBytes(call).first(10), 1ms);
    talk.segment_by_client(ConstBytes(call).subspan(10, 1000), 2ms);
    talk.segment_by_client(ConstBytes(call).subspan(1010), 3ms);
    const Bytes reply = unsent.complete(unsent.to_server(call, 3ms), Bytes(5, std::byte{2}), 4ms);
    talk.sent_by_server(reply, 4ms);
    // One segment has two calls.
    unsent.to_client(reply, 4ms);
    const Bytes second = unsent.call(7, 3, {}, 5ms);
    const Bytes second_reply = unsent.complete(unsent.to_server(second, 5ms), {}, 5ms);
    unsent.to_client(second_reply, 5ms);
    Bytes both = second;
    const Bytes third = unsent.call(7, 4, {}, 5ms);
    both.insert(both.end(), third.begin(), third.end());
    talk.segment_by_client(both, 5ms);
    talk.sent_by_server(second_reply, 6ms);

    const auto rows =
        dissect(talk.capture, {"rtpm.kind", "rtpm.call_id", "rtpm.method", "rtpm.payload_size",
                               "rtpm.request_in", "rtpm.reply_in", "rtpm.time", "rtpm.drop"});
    ASSERT_EQ(rows.size(), 8u);
    EXPECT_EQ(column(rows, "rtpm.kind"), (Column{"1", "3", "", "", "5", "6", "5,5", "6"}));
    EXPECT_EQ(column(rows, "rtpm.call_id"), (Column{"1", "1", "", "", "1", "1", "2,3", "2"}));
    EXPECT_EQ(rows[6].at("rtpm.method"), "3,4");
    EXPECT_EQ(rows[4].at("rtpm.payload_size"), "1500");
    EXPECT_EQ(column(rows, "rtpm.request_in"), (Column{"", "1", "", "", "", "5", "", "7"}));
    EXPECT_EQ(column(rows, "rtpm.reply_in"), (Column{"2", "", "", "", "6", "", "8", ""}));
    EXPECT_EQ(rows[5].at("rtpm.time"), "0.001000000");
    EXPECT_EQ(column(rows, "rtpm.drop"), Column(8, ""));
  }
}

// A bind larger than a frame would not be legal; but the fragments of any call are reassembled, and
// the whole becomes readable.
TEST_F(Dissector, ReassemblesFragments) {
  Talk talk(wire::Medium::kDatagram, kDefaultPort);
  talk.open(0us);
  Bytes message(1500, std::byte{0xab});
  message.back() = std::byte{0xcd};
  static_cast<void>(talk.call(7, 2, message, 1ms));
  // Repeats the first fragment, as if its ACK were lost.
  static_cast<void>(talk.repeat(10ms));
  const auto rows = dissect(talk.capture, {"rtpm.fragment_index", "rtpm.whole_in", "rtpm.message",
                                           "rtpm.copy_of", "rtpm.drop", "rtpm.expert.gap"});
  ASSERT_EQ(rows.size(), 7u);
  EXPECT_EQ(column(rows, "rtpm.fragment_index"), (Column{"0", "0", "0", "0", "0", "1", "0"}));
  EXPECT_EQ(column(rows, "rtpm.whole_in"), (Column{"", "", "", "", "6", "6", "6"}));
  EXPECT_EQ(rows[5].at("rtpm.message"), hex_of(message));
  EXPECT_EQ(rows[4].at("rtpm.message"), "");
  EXPECT_EQ(column(rows, "rtpm.copy_of"), (Column{"", "", "", "", "", "", "5"}));
  EXPECT_EQ(column(rows, "rtpm.drop"), Column(7, ""));
  EXPECT_EQ(column(rows, "rtpm.expert.gap"), Column(7, ""));
}

TEST_F(Dissector, LinksAStreamToItsCall) {
  Talk talk(wire::Medium::kDatagram, kDefaultPort);
  talk.open(0us);
  wire::CallParameters wanted{7, 2, kPriority, 0x7ace, kNever};
  wanted.stream_window = 4;
  const Bytes call = talk.call(wanted, {}, 1ms);
  const wire::Verdict verdict = talk.to_server(call, 1ms);
  std::vector<Bytes> items;
  for (int i = 0; i < 3; ++i) {
    items.push_back(Talk::copy_of(talk.server().push_item(verdict.request, Bytes(5), at(2ms))));
  }
  // The second item is lost, and repeated.
  for (const std::size_t i : {0u, 2u}) {
    talk.sent_by_server(items[i], 3ms);
    EXPECT_EQ(talk.client().on_frame(items[i], at(3ms)).kind, wire::ChannelEvent::Kind::kItems);
    const Bytes credit = Talk::copy_of(talk.client().next_frame(at(4ms)));
    talk.sent_by_client(credit, 4ms);
    if (credit.empty()) continue;
    talk.sent_by_server(Talk::copy_of(talk.to_server(credit, 5ms).frame), 5ms);
  }
  talk.sent_by_server(items[2], 6ms);
  talk.sent_by_client(Talk::copy_of(talk.client().cancel(0, at(7ms))), 7ms);
  const auto rows =
      dissect(talk.capture, {"rtpm.kind", "rtpm.item", "rtpm.call_in", "rtpm.time", "rtpm.copy_of",
                             "rtpm.credit.first_missing", "rtpm.credit.later", "rtpm.expert.gap",
                             "rtpm.expert.repeated", "rtpm.expert.cancelled", "rtpm.drop"});
  ASSERT_EQ(rows.size(), 11u);
  EXPECT_EQ(column(rows, "rtpm.kind"),
            (Column{"1", "2", "1", "3", "5", "10", "10", "11", "10", "10", "9"}));
  EXPECT_EQ(column(rows, "rtpm.item"),
            (Column{"0", "0", "0", "0", "4", "0", "2", "4", "1", "2", "0"}));
  EXPECT_EQ(column(rows, "rtpm.call_in"),
            (Column{"", "", "", "", "", "5", "5", "5", "5", "5", "5"}));
  EXPECT_EQ(rows[6].at("rtpm.time"), "0.002000000");
  EXPECT_EQ(rows[7].at("rtpm.credit.first_missing"), "1");
  EXPECT_EQ(rows[7].at("rtpm.credit.later"), "0x0000000000000001");
  std::vector<bool> gaps, copies, cancels;
  for (const Row& row : rows) {
    gaps.push_back(!row.at("rtpm.expert.gap").empty());
    copies.push_back(!row.at("rtpm.expert.repeated").empty());
    cancels.push_back(!row.at("rtpm.expert.cancelled").empty());
  }
  using Flags = std::vector<bool>;
  EXPECT_EQ(gaps, (Flags{0, 0, 0, 0, 0, 0, 1, 1, 0, 0, 0}));
  EXPECT_EQ(copies, (Flags{0, 0, 0, 0, 0, 0, 0, 0, 1, 1, 0}));
  EXPECT_EQ(cancels, (Flags{0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1}));
  EXPECT_EQ(rows[9].at("rtpm.copy_of"), "7");
  EXPECT_EQ(column(rows, "rtpm.drop"), Column(11, ""));
}

// hp-5.10-1
TEST_F(Dissector, ReassemblesLargeItems) {
  Talk talk(wire::Medium::kDatagram, kDefaultPort);
  talk.open(0us);
  wire::CallParameters wanted{7, 2, kPriority, 0x7ace, kNever};
  wanted.stream_window = 4;
  const Bytes call = talk.call(wanted, {}, 1ms);
  const wire::Verdict verdict = talk.to_server(call, 1ms);
  std::vector<Bytes> items;
  for (int i = 0; i < 2; ++i) {
    items.emplace_back(3000, static_cast<std::byte>('a' + i));
    do {
      talk.sent_by_server(
          Talk::copy_of(talk.server().push_item(verdict.request, items.back(), at(2ms))), 2ms);
    } while (talk.server().is_item_midway(verdict.request));
  }
  const auto rows = dissect(talk.capture, {"rtpm.kind", "rtpm.item", "rtpm.fragment_index",
                                           "rtpm.message", "rtpm.expert.gap", "rtpm.drop"});
  ASSERT_EQ(rows.size(), 11u);
  EXPECT_EQ(rows[7].at("rtpm.item"), "2");
  EXPECT_EQ(rows[7].at("rtpm.message"), hex_of(items[0]));
  EXPECT_EQ(rows[8].at("rtpm.fragment_index"), "0");
  EXPECT_EQ(rows[8].at("rtpm.message"), "");
  EXPECT_EQ(rows[10].at("rtpm.message"), hex_of(items[1]));
  EXPECT_EQ(column(rows, "rtpm.expert.gap"), Column(11, ""));
  EXPECT_EQ(column(rows, "rtpm.drop"), Column(11, ""));
}

TEST_F(Dissector, ReportsWhyAHeaderIsDropped) {
  const Json document = read_vectors("headers-bad.json");
  Capture capture;
  Column wanted;
  wire::Header sealed;
  for (const Json& vector : document.at("vectors")) {
    const Bytes frame = bytes_of_hex(vector.at("hex"));
    // A frame for the other side is an ordinary one; Wireshark calls no dissector for an empty
    // datagram.
    if (vector.at("receiver") != "any" || frame.empty()) continue;
    capture.add_datagram(kClient, kServer, frame, at(0us));
    // The dissector knows bit 4 (sec-4-1), but there is no trailer.
    const auto read = wire::decode_sealed_frame(frame, wire::Medium::kDatagram, sealed);
    const bool is_without_trailer = !read && read.error() == wire::DropReason::kBadLength;
    wanted.push_back(is_without_trailer ? "bad_length" : vector.at("drop"));
  }
  EXPECT_GT(wanted.size(), 30u);
  const auto rows = dissect(capture, {"rtpm.drop", "rtpm.expert.malformed"});
  EXPECT_EQ(column(rows, "rtpm.drop"), wanted);
  for (const Row& row : rows)
    EXPECT_NE(row.at("rtpm.expert.malformed"), "");
}

TEST_F(Dissector, FindsNoFaultInGoodHeaders) {
  const Json document = read_vectors("headers-good.json");
  Capture capture;
  for (const Json& vector : document.at("vectors")) {
    capture.add_datagram(kClient, kServer, bytes_of_hex(vector.at("hex")), at(0us));
  }
  const auto rows = dissect(
      capture, {"rtpm.drop", "rtpm.priority", "rtpm.session", "rtpm.call_id", "rtpm.service",
                "rtpm.method", "rtpm.budget_us", "rtpm.status", "rtpm.trace_id"});
  ASSERT_EQ(rows.size(), document.at("vectors").size());
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const Json& vector = document.at("vectors")[i];
    SCOPED_TRACE(vector.at("name"));
    const Json& header = vector.at("header");
    EXPECT_EQ(rows[i].at("rtpm.drop"), "");
    for (const char* name : {"priority", "call_id", "service", "method", "budget_us"}) {
      EXPECT_EQ(rows[i].at("rtpm." + std::string(name)), header.at(name).dump()) << name;
    }
    EXPECT_EQ(rows[i].at("rtpm.session"), header.at("session"));
    EXPECT_EQ(rows[i].at("rtpm.trace_id"), header.at("trace_id"));
    const auto status = static_cast<int>(status_named(header.at("status")));
    EXPECT_EQ(rows[i].at("rtpm.status"), std::to_string(status));
  }
}

TEST_F(Dissector, ReportsDroppedPayloads) {
  struct Kind {
    const char* file;
    wire::FrameKind kind;
  };
  Capture capture;
  Column wanted;
  const auto add = [&](const wire::Header& header, const std::string& hex,
                       const std::string& drop) {
    capture.add_datagram(kClient, kServer, frame_with(header, bytes_of_hex(hex)), at(0us));
    wanted.push_back(drop);
  };
  for (const Kind& kind :
       {Kind{"hello.json", wire::FrameKind::kHello}, Kind{"cookie.json", wire::FrameKind::kCookie},
        Kind{"welcome.json", wire::FrameKind::kWelcome}, Kind{"ack.json", wire::FrameKind::kAck},
        Kind{"credit.json", wire::FrameKind::kCredit}}) {
    const Json document = read_vectors(kind.file);
    const auto header_for = [&](const Json& vector) {
      wire::Header header{.kind = kind.kind};
      if (vector.contains("session")) header.session = wide_number(vector.at("session"));
      return header;
    };
    for (const Json& vector : document.at("good"))
      add(header_for(vector), vector.at("hex"), "");
    for (const Json& vector : document.at("bad")) {
      // The frame does not show the client's requested priority.
      const std::string name = vector.at("name");
      if (name == "a band below the priority" || name == "a band above the priority") continue;
      add(header_for(vector), vector.at("hex"), vector.at("drop"));
    }
  }
  const Json replies = read_vectors("bind-reply.json");
  for (const Json& vector : replies.at("good")) {
    add({.kind = wire::FrameKind::kReply, .method = wire::kMethodBind}, vector.at("hex"), "");
  }
  const auto rows = dissect(capture, {"rtpm.drop"});
  EXPECT_EQ(column(rows, "rtpm.drop"), wanted);
}

// The script itself never fails, in any conversation.
TEST_F(Dissector, ReadsEveryConversationOfTheVectors) {
  Capture capture;
  std::uint16_t port = 50000;  // No other protocol is expected there.
  std::size_t dropped_count = 0;
  for (const std::string& name : conversation_names()) {
    const Json document = read_vectors("conversations/" + name + ".json");
    const End client{.host = 1, .port = ++port};
    for (const Json& step : document.at("steps")) {
      if (!step.contains("frame")) continue;
      std::string hex = step.at("hex");
      for (const auto& [placeholder, choice] : document.at("free").items()) {
        hex = std::regex_replace(hex, std::regex("<" + placeholder + ">"),
                                 choice.at("example").get<std::string>());
      }
      const std::string way = step.at("frame");
      const bool is_from_client = way == "client to server" || way == "network to server";
      const MonotonicTime when = time_from_ns(step.at("at_ns"));
      const End from = is_from_client ? client : kServer;
      const End to = is_from_client ? kServer : client;
      if (document.at("medium") == "datagram") {
        capture.add_datagram(from, to, bytes_of_hex(hex), when);
      } else {
        capture.add_segment(from, to, bytes_of_hex(hex), when);
      }
    }
  }
  for (const Row& row : dissect(capture, {"rtpm.kind", "rtpm.drop", "_ws.expert.message",
                                          "frame.number", "_ws.col.Info"})) {
    EXPECT_NE(row.at("rtpm.kind"), "") << row.at("frame.number") << row.at("_ws.col.Info");
    EXPECT_EQ(row.at("_ws.expert.message").find("Lua"), std::string::npos)
        << row.at("_ws.expert.message");
    if (!row.at("rtpm.drop").empty()) ++dropped_count;
  }
  EXPECT_GT(dropped_count, 0u);
  EXPECT_LT(dropped_count, 40u);
}

}  // namespace
}  // namespace rtpm::spec
