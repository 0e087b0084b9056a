// spec/vectors/sealed.json: handshakes, frames, windows and keys of sealed sessions, made by a
// client written from spec/security.md alone.

#include <gtest/gtest.h>

#include <optional>

#include "rtpm/crypto/session.hpp"
#include "rtpm/wire/sealed.hpp"
#include "vectors.hpp"

namespace rtpm::spec {
namespace {

Json sealed_vectors(const char* key) {
  return read_vectors("sealed.json").at(key);
}

/// The vector's suite; nullopt if this machine lacks the hardware for it.
std::optional<crypto::Suite> suite_of(const Json& vector) {
  for (const crypto::Suite suite : {crypto::Suite::kChaChaPoly, crypto::Suite::kAesGcm}) {
    if (vector.at("suite") != crypto::protocol_name(suite)) continue;
    if ((crypto::suites_here() & static_cast<unsigned>(suite)) != 0) return suite;
  }
  return std::nullopt;
}

crypto::Secret secret_at(const Json& vector, const char* key) {
  return crypto::Secret(std::span<const std::byte, crypto::kKeySize>(
      bytes_of_hex(vector.at(key).get<std::string>())));
}
Bytes bytes_at(const Json& vector, const char* key) {
  return bytes_of_hex(vector.at(key).get<std::string>());
}

/// A receiver and a sender of one key.
crypto::SessionKeys keys_of(const Json& vector, crypto::Suite suite) {
  return {suite, secret_at(vector, "key"), secret_at(vector, "key"), {}};
}

/// Why `frame` is dropped; "" if it is opened.
std::string opened_as(crypto::SealedSession& session, Bytes frame) {
  wire::Header header;
  const auto read = wire::decode_sealed_frame(frame, wire::Medium::kDatagram, header);
  if (!read) return std::string(to_string(read.error()));
  const auto opened = session.open(wire::kHeaderSize, frame);
  if (opened) return {};
  const bool is_replayed = opened.error() == crypto::OpenError::kReplayed;
  return std::string(
      to_string(is_replayed ? wire::DropReason::kReplayed : wire::DropReason::kBadSeal));
}

/// A HELLO of the vectors, in its parts.
struct HelloParts {
  explicit HelloParts(const Json& vector) : frame(bytes_at(vector, "hello")) {
    header = *wire::decode_frame(frame);
    payload = ConstBytes(frame).subspan(wire::kHeaderSize);
    cookie = bytes_at(vector, "cookie");
    prologue = wire::prologue_of(
        header, std::span<const std::byte, wire::Hello::kSize>(payload.first(wire::Hello::kSize)),
        cookie);
  }
  Bytes frame;
  wire::Header header;
  ConstBytes payload;
  Bytes cookie;
  wire::Prologue prologue{};
};

void expect_keys(const crypto::SessionKeys& keys, const Json& vector, const char* ours,
                 const char* theirs) {
  EXPECT_EQ(hex_of(keys.send.bytes()), vector.at(ours));
  EXPECT_EQ(hex_of(keys.receive.bytes()), vector.at(theirs));
  EXPECT_EQ(hex_of(keys.handshake_hash), vector.at("handshake_hash"));
}

// sec-3.4-1, sec-3.2-1, sec-3.3-1: the client's side, byte by byte.
TEST(SealedVectors, HandshakesOfTheClient) {
  for (const Json& vector : sealed_vectors("handshakes")) {
    SCOPED_TRACE(vector.at("name"));
    const auto suite = suite_of(vector);
    if (!suite) continue;
    const HelloParts hello(vector);
    EXPECT_EQ(hex_of(hello.prologue), vector.at("prologue"));
    const auto server = crypto::KeyPair::of(secret_at(vector, "server_private"));
    crypto::Initiator initiator(*suite, crypto::KeyPair::of(secret_at(vector, "client_private")),
                                server.public_key, secret_at(vector, "psk"),
                                crypto::KeyPair::of(secret_at(vector, "client_ephemeral")),
                                hello.prologue);
    Bytes former(wire::kMessage1PayloadSize);
    store_le(former.data(), wide_number(vector.at("former_session")));
    Bytes message(wire::SealedHello::kMessageSize);
    ASSERT_TRUE(initiator.write_message_1(former, message));
    EXPECT_EQ(hex_of(message), hex_of(hello.payload.subspan(wire::Hello::kSize)));

    const Bytes welcome = bytes_at(vector, "welcome");
    const auto header = wire::decode_frame(welcome);
    ASSERT_TRUE(header);
    ASSERT_EQ(header->payload_size, wire::SealedWelcome::kSize);
    Bytes inside(wire::SealedWelcome::kInnerSize);
    ASSERT_TRUE(initiator.read_message_2(ConstBytes(welcome).subspan(wire::kHeaderSize), inside));
    const auto read = wire::decode_sealed_welcome(
        inside, wire::decode_sealed_hello(hello.payload)->hello.features);
    ASSERT_TRUE(read);
    EXPECT_EQ(read->session, header->session);
    EXPECT_EQ(static_cast<int>(read->former), vector.at("former"));
    expect_keys(*initiator.keys(), vector, "client_key", "server_key");
  }
}

TEST(SealedVectors, HandshakesOfTheServer) {
  for (const Json& vector : sealed_vectors("handshakes")) {
    SCOPED_TRACE(vector.at("name"));
    const auto suite = suite_of(vector);
    if (!suite) continue;
    const HelloParts parts(vector);
    const auto hello = wire::decode_sealed_hello(parts.payload);
    ASSERT_TRUE(hello);
    EXPECT_EQ((hello->hello.features & wire::kFeatureAesGcm) != 0,
              *suite == crypto::Suite::kAesGcm);
    crypto::Responder responder(*suite, crypto::KeyPair::of(secret_at(vector, "server_private")),
                                secret_at(vector, "psk"), parts.prologue);
    Bytes former(wire::kMessage1PayloadSize);
    const auto client = responder.read_message_1(hello->message, former);
    ASSERT_TRUE(client);
    EXPECT_EQ(*client, crypto::KeyPair::of(secret_at(vector, "client_private")).public_key);
    EXPECT_EQ(load_le<std::uint64_t>(former.data()), wide_number(vector.at("former_session")));

    const Bytes inside = bytes_at(vector, "welcome_inside");
    const auto read = wire::decode_sealed_welcome(inside, hello->hello.features);
    ASSERT_TRUE(read);
    Bytes again(wire::SealedWelcome::kInnerSize);
    encode(*read, again);
    EXPECT_EQ(again, inside);
    Bytes message(wire::SealedWelcome::kSize);
    ASSERT_TRUE(responder.write_message_2(
        crypto::KeyPair::of(secret_at(vector, "server_ephemeral")), inside, message));
    EXPECT_EQ(hex_of(message),
              hex_of(ConstBytes(bytes_at(vector, "welcome")).subspan(wire::kHeaderSize)));
    expect_keys(*responder.keys(), vector, "server_key", "client_key");
  }
}

// sec-3.1-1
TEST(SealedVectors, CookieRoundTrips) {
  const Json vector = sealed_vectors("cookie");
  const Bytes payload = bytes_at(vector, "hex");
  const auto cookie = wire::decode_sealed_cookie(payload);
  ASSERT_TRUE(cookie);
  EXPECT_EQ(hex_of(cookie->cookie), vector.at("cookie"));
  EXPECT_EQ(hex_of(cookie->server_key), vector.at("server_key"));
  EXPECT_EQ(cookie->suites, vector.at("suites"));
  Bytes again(wire::SealedCookie::kSize);
  encode(*cookie, again);
  EXPECT_EQ(again, payload);
  EXPECT_LT(wire::kHeaderSize + payload.size(), wire::kHeaderSize + wire::Hello::kSize);
}

// sec-3-2, sec-3.1-2, sec-3.2-1, sec-3.3-1
TEST(SealedVectors, BadPayloadsAreNotRead) {
  for (const Json& vector : sealed_vectors("bad_payloads")) {
    SCOPED_TRACE(vector.at("name"));
    const Bytes payload = bytes_at(vector, "hex");
    if (vector.at("kind") == "COOKIE") {
      EXPECT_FALSE(wire::decode_sealed_cookie(payload));
    } else if (vector.at("kind") == "HELLO") {
      EXPECT_FALSE(wire::decode_sealed_hello(payload));
    } else {
      EXPECT_FALSE(wire::decode_sealed_welcome(payload, wire::kFeatureSealed));
    }
  }
}

// sec-4-1, sec-4-3, sec-5-1: one session, frame after frame.
TEST(SealedVectors, FramesAreSealedAndOpened) {
  std::optional<crypto::SealedSession> sender, receiver;
  for (const Json& vector : sealed_vectors("frames")) {
    SCOPED_TRACE(vector.at("name"));
    const auto suite = suite_of(vector);
    if (!suite) continue;
    if (vector.at("counter") == 0) {
      sender.emplace(keys_of(vector, *suite), crypto::Order::kAny);
      receiver.emplace(keys_of(vector, *suite), crypto::Order::kExact);
    }
    const Bytes header = bytes_at(vector, "header");
    const Bytes payload = bytes_at(vector, "payload");
    // Sealing changes only a flag of the header.
    Bytes plain = header;
    wire::unmark_sealed(plain.data());
    EXPECT_TRUE(wire::decode(plain));
    wire::mark_sealed(plain.data());
    EXPECT_EQ(plain, header);

    Bytes frame(header.size() + payload.size() + crypto::kTrailerSize);
    ASSERT_TRUE(sender->seal(header, payload, frame));
    EXPECT_EQ(hex_of(frame), vector.at("hex"));
    wire::Header read;
    ASSERT_TRUE(wire::decode_sealed_frame(frame, wire::Medium::kDatagram, read));
    EXPECT_TRUE(wire::is_sealed(frame));
    const auto opened = receiver->open(wire::kHeaderSize, frame);
    ASSERT_TRUE(opened);
    EXPECT_EQ(hex_of(*opened), hex_of(payload));
  }
}

// sec-4-2, sec-4-4, sec-5-3
TEST(SealedVectors, BadFramesAreDroppedAndChangeNothing) {
  std::optional<crypto::SealedSession> session;
  const Json vectors = sealed_vectors("bad_frames");
  session.emplace(keys_of(vectors.at(0), *suite_of(vectors.at(0))), crypto::Order::kAny);
  for (const Json& vector : vectors) {
    SCOPED_TRACE(vector.at("name"));
    if (vector.at("drop") == "") continue;
    EXPECT_EQ(opened_as(*session, bytes_at(vector, "hex")), vector.at("drop"));
  }
  EXPECT_FALSE(session->is_confirmed());
  EXPECT_EQ(opened_as(*session, bytes_at(vectors.at(0), "hex")), "");
}

// A receiver without level S drops them (hp-2-2).
TEST(SealedVectors, OrdinaryDecodersRejectSealedFrames) {
  for (const Json& vector : sealed_vectors("frames")) {
    const auto read = wire::decode_frame(bytes_at(vector, "hex"));
    ASSERT_FALSE(read);
    EXPECT_EQ(read.error(), wire::DropReason::kReservedSet);
  }
}

// sec-5-5
TEST(SealedVectors, EachKeyDerivesFromThePreviousOne) {
  for (const Json& vector : sealed_vectors("keys")) {
    const auto suite = suite_of(vector);
    if (!suite) continue;
    crypto::AeadKey key;
    const Json& keys = vector.at("keys");
    key.set(*suite, crypto::Secret(std::span<const std::byte, crypto::kKeySize>(
                        bytes_of_hex(keys.at(0).get<std::string>()))));
    for (std::size_t i = 1; i < keys.size(); ++i) {
      crypto::AeadKey next, same;
      next.set_next_of(key);
      same.set(*suite, crypto::Secret(std::span<const std::byte, crypto::kKeySize>(
                           bytes_of_hex(keys.at(i).get<std::string>()))));
      // Two keys are alike if one opens what the other seals.
      Bytes text(5), sealed(5), tag(crypto::kTagSize);
      same.seal(7, {}, text, sealed, std::span<std::byte, crypto::kTagSize>(tag));
      EXPECT_TRUE(
          next.open(7, {}, sealed, std::span<const std::byte, crypto::kTagSize>(tag), text));
      key.copy_from(next);
    }
  }
}

// sec-5-4, sec-5-5, sec-5-6
TEST(SealedVectors, WindowsAndKeysAcceptTheRightFrames) {
  for (const Json& vector : sealed_vectors("windows")) {
    SCOPED_TRACE(vector.at("name"));
    const auto suite = suite_of(vector);
    if (!suite) continue;
    crypto::SealedSession session(keys_of(vector, *suite), crypto::Order::kAny);
    for (const Json& step : vector.at("steps")) {
      EXPECT_EQ(opened_as(session, bytes_at(step, "hex")), step.value("drop", ""))
          << step.at("counter");
    }
  }
}

}  // namespace
}  // namespace rtpm::spec
