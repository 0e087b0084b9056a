#include <gtest/gtest.h>

#include <algorithm>
#include <array>

#include "capture.hpp"
#include "peers.hpp"
#include "rtpm/crypto/session.hpp"
#include "rtpm/wire/sealed.hpp"
#include "talk.hpp"
#include "vectors.hpp"

// Sealed frames in spec/wireshark/hprotocol.lua: the fields that it shows without keys, and those
// with a key log.
namespace rtpm::spec {
namespace {

using namespace std::chrono_literals;

constexpr std::uint64_t kSession = 0xb7fc5e0b78510000;

class SealedDissector : public DissectorTest {};

std::vector<crypto::Suite> suites() {
  std::vector<crypto::Suite> all{crypto::Suite::kChaChaPoly};
  if (crypto::best_suite(crypto::suites_here(), 3) == crypto::Suite::kAesGcm) {
    all.push_back(crypto::Suite::kAesGcm);
  }
  return all;
}

/// One direction of a session: its keys by generation, as our code makes them.
class Direction {
 public:
  Direction(crypto::Suite suite, std::byte filling) : suite_(suite) {
    std::ranges::fill(key_.bytes(), filling);
  }
  [[nodiscard]] std::string hex() const {
    return hex_of(Bytes(key_.bytes().begin(), key_.bytes().end()));
  }
  [[nodiscard]] Bytes seal(wire::Header header, const Bytes& payload, std::uint64_t counter) const {
    crypto::AeadKey key;
    key.set(suite_, key_);
    for (std::uint64_t generation = counter >> 22; generation > 0; --generation) {
      crypto::AeadKey next;
      next.set_next_of(key);
      key.copy_from(next);
    }
    header.session = kSession;
    header.payload_size = header.message_size = static_cast<std::uint32_t>(payload.size());
    Bytes frame(wire::kHeaderSize + payload.size() + crypto::kTrailerSize);
    wire::encode(header, frame.data());
    wire::mark_sealed(frame.data());
    const MutableBytes out(frame);
    store_le(frame.data() + wire::kHeaderSize + payload.size(), counter);
    key.seal(counter, out.first(wire::kHeaderSize), payload,
             out.subspan(wire::kHeaderSize, payload.size()),
             std::span<std::byte, crypto::kTagSize>(out.last(crypto::kTagSize)));
    return frame;
  }

 private:
  crypto::Suite suite_;
  crypto::Secret key_;
};

Bytes bind_reply() {
  Bytes bytes(wire::BindReply::kSize);
  wire::encode(wire::BindReply{.service = 7, .fingerprint = 0x1234}, bytes);
  return bytes;
}

/// A bind, then calls around all edges of keys, of all sizes.
constexpr std::array<std::uint64_t, 6> kCounters{1,        (1U << 22) - 1, 1U << 22,
                                                 3U << 22, (3U << 22) - 2, (100U << 22) + 5};
constexpr std::array<std::size_t, 6> kSizes{0, 1, 16, 48, 64, 1320};

Bytes payload_of(std::size_t size) {
  Bytes payload(size);
  for (std::size_t i = 0; i < size; ++i)
    payload[i] = static_cast<std::byte>(3 * i + 1);
  return payload;
}

Capture captured(const Direction& client, const Direction& server, bool is_stream) {
  Capture capture;
  const auto add = [&](bool is_from_client, const Bytes& frame, Duration when) {
    const End from = is_from_client ? kClient : kServer;
    const End to = is_from_client ? kServer : kClient;
    if (is_stream) return capture.add_segment(from, to, frame, at(when));
    capture.add_datagram(from, to, frame, at(when));
  };
  using wire::FrameKind;
  add(true, client.seal({.kind = FrameKind::kCall, .call_id = 1, .method = 1}, bind_request(), 0),
      0us);
  add(false, server.seal({.kind = FrameKind::kReply, .call_id = 1, .method = 1}, bind_reply(), 0),
      1us);
  std::uint32_t call_id = 1;
  for (std::size_t i = 0; i < kCounters.size(); ++i) {
    const wire::Header about{.call_id = ++call_id, .service = 7, .method = 2};
    wire::Header call = about;
    call.kind = FrameKind::kCall;
    wire::Header reply = about;
    reply.kind = FrameKind::kReply;
    add(true, client.seal(call, payload_of(kSizes[i]), kCounters[i]), 2us);
    add(false, server.seal(reply, payload_of(kSizes[i]), kCounters[i]), 3us);
  }
  return capture;
}

std::string log_line(crypto::Suite suite, const Direction& client, const Direction& server) {
  return "RTPM_SESSION b7fc5e0b78510000 " +
         std::string(suite == crypto::Suite::kAesGcm ? "aes-256-gcm" : "chacha20-poly1305") + " " +
         client.hex() + " " + server.hex() + "\n";
}

// spec/security.md#sec-9
TEST_F(SealedDissector, OpensFramesByAKeyLog) {
  for (const crypto::Suite suite : suites()) {
    for (const bool is_stream : {false, true}) {
      const Direction client(suite, std::byte{0x55});
      const Direction server(suite, std::byte{0x66});
      const auto rows = dissect(
          captured(client, server, is_stream),
          {"rtpm.kind", "rtpm.payload", "rtpm.bind.path", "rtpm.object", "rtpm.sealed.counter",
           "rtpm.sealed.generation", "rtpm.flags.sealed", "rtpm.reply_in", "rtpm.drop"},
          "# other lines are passed over\n" + log_line(suite, client, server));
      ASSERT_EQ(rows.size(), 2 + 2 * kCounters.size());
      EXPECT_EQ(rows[0].at("rtpm.bind.path"), "lab/arm0");
      EXPECT_EQ(rows[0].at("rtpm.reply_in"), "2");
      for (std::size_t i = 0; i < kCounters.size(); ++i) {
        for (const Row& row : {rows[2 + 2 * i], rows[3 + 2 * i]}) {
          EXPECT_EQ(row.at("rtpm.payload"), hex_of(payload_of(kSizes[i]))) << kCounters[i];
          EXPECT_EQ(row.at("rtpm.object"), "lab/arm0");
          EXPECT_EQ(row.at("rtpm.sealed.counter"), std::to_string(kCounters[i]));
          EXPECT_EQ(row.at("rtpm.sealed.generation"), std::to_string(kCounters[i] >> 22));
          EXPECT_EQ(row.at("rtpm.flags.sealed"), "1");
          EXPECT_EQ(row.at("rtpm.drop"), "");
        }
      }
    }
  }
}

// A whole conversation of our client and lane, with the line that the server writes to its key log.
TEST_F(SealedDissector, OpensASessionByTheServersKeyLog) {
  sealed::test::Server server;
  sealed::test::Client client(server.identity.key.public_key);
  Capture capture;
  const MonotonicTime now = at(0us);
  client.open(now);
  client.call_when_ready("move to zero", now);
  while (!client.sent.empty()) {
    const Bytes frame = client.sent.front();
    client.sent.pop_front();
    capture.add_datagram(kClient, kServer, frame, now);
    for (const Bytes& answer : server.receive(frame, now)) {
      capture.add_datagram(kServer, kClient, answer, now);
      client.receive(answer, now);
    }
    client.call_when_ready("move to zero", now);
  }
  const auto rows = dissect(capture, {"rtpm.kind", "rtpm.payload", "rtpm.drop"}, server.key_log);
  ASSERT_EQ(rows.size(), 6u);
  const std::string text = "move to zero";
  const auto bytes = std::as_bytes(std::span(text));
  for (const std::size_t i : {4u, 5u})
    EXPECT_EQ(rows[i].at("rtpm.payload"), hex_of(Bytes(bytes.begin(), bytes.end())));
  for (const Row& row : rows)
    EXPECT_EQ(row.at("rtpm.drop"), "");
}

TEST_F(SealedDissector, ShowsReadableFieldsWithoutKeys) {
  const Direction client(crypto::Suite::kChaChaPoly, std::byte{0x55});
  const Direction server(crypto::Suite::kChaChaPoly, std::byte{0x66});
  for (const std::string& log : {std::string(), std::string("RTPM_SESSION 12 aes-256-gcm 5 6\n")}) {
    const auto rows = dissect(captured(client, server, false),
                              {"rtpm.payload", "rtpm.object", "rtpm.sealed.encrypted",
                               "rtpm.sealed.tag", "rtpm.reply_in", "rtpm.drop"},
                              log);
    ASSERT_EQ(rows.size(), 2 + 2 * kCounters.size());
    for (const Row& row : rows) {
      EXPECT_EQ(row.at("rtpm.payload"), "");
      EXPECT_EQ(row.at("rtpm.object"), "");
      EXPECT_EQ(row.at("rtpm.sealed.tag").size(), 32u);
      EXPECT_EQ(row.at("rtpm.drop"), "");
    }
    EXPECT_EQ(rows[8].at("rtpm.sealed.encrypted").size(), 2 * kSizes[3]);
    EXPECT_EQ(rows[8].at("rtpm.reply_in"), "10");
  }
}

// The vectors' frames, and those of their faults that show without a key.
TEST_F(SealedDissector, ReportsDroppedFrames) {
  const Json document = read_vectors("sealed.json");
  Capture capture;
  Column wanted;
  const auto add = [&](const Bytes& frame, const std::string& drop) {
    capture.add_datagram(kClient, kServer, frame, at(0us));
    wanted.push_back(drop);
  };
  for (const Json& vector : document.at("frames"))
    add(bytes_of_hex(vector.at("hex")), "");
  for (const Json& vector : document.at("bad_frames")) {
    const std::string drop = vector.at("drop");
    const bool needs_key = drop == "bad_seal" || drop == "replayed";
    // A frame without the flag does not show that its session is sealed.
    if (drop == "unsealed") continue;
    add(bytes_of_hex(vector.at("hex")), needs_key ? "" : drop);
  }
  const auto rows = dissect(capture, {"rtpm.drop"});
  ASSERT_EQ(rows.size(), wanted.size());
  for (std::size_t i = 0; i < rows.size(); ++i)
    EXPECT_EQ(rows[i].at("rtpm.drop"), wanted[i]) << i;
}

TEST_F(SealedDissector, ReadsHandshakes) {
  const Json document = read_vectors("sealed.json");
  const Json& handshake = document.at("handshakes").at(0);
  Capture capture;
  capture.add_datagram(kClient, kServer, bytes_of_hex(handshake.at("hello")), at(0us));
  capture.add_datagram(kServer, kClient, bytes_of_hex(handshake.at("welcome")), at(1us));
  const Bytes cookie =
      frame_with({.kind = wire::FrameKind::kCookie}, bytes_of_hex(document.at("cookie").at("hex")));
  capture.add_datagram(kServer, kClient, cookie, at(2us));
  const auto rows = dissect(
      capture, {"rtpm.hello.features", "rtpm.sealed_hello.ephemeral", "rtpm.sealed_welcome.payload",
                "rtpm.sealed_cookie.server_key", "rtpm.request_in", "rtpm.drop"});
  EXPECT_EQ(rows[0].at("rtpm.hello.features"), "0x00000001");
  EXPECT_EQ(rows[0].at("rtpm.sealed_hello.ephemeral").size(), 64u);
  EXPECT_EQ(rows[1].at("rtpm.sealed_welcome.payload").size(), 160u);
  EXPECT_EQ(rows[1].at("rtpm.request_in"), "1");
  EXPECT_EQ(rows[2].at("rtpm.sealed_cookie.server_key"), document.at("cookie").at("server_key"));
  for (const Row& row : rows)
    EXPECT_EQ(row.at("rtpm.drop"), "");
}

}  // namespace
}  // namespace rtpm::spec
