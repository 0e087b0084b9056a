#include "rtpm/crypto/handshake.hpp"

#include <gtest/gtest.h>

#include "crypto_fixture.hpp"

namespace rtpm::crypto::test {
namespace {

const Bytes kPrologue{std::byte{7}, std::byte{8}};

/// A client and a server that know each other, at the point where a test begins.
class Handshake {
 public:
  explicit Handshake(Suite suite, std::uint64_t seed = 1)
      : random(seed), client_key(random_pair(random)), server_key(random_pair(random)) {
    initiator.emplace(suite, client_key.clone(), server_key.public_key, Secret{},
                      random_pair(random), kPrologue);
    responder.emplace(suite, server_key.clone(), Secret{}, kPrologue);
  }
  Bytes write_1(std::size_t payload_size = 20) {
    payload_1 = random_bytes(random, payload_size);
    Bytes message(message_1_size(payload_size));
    EXPECT_TRUE(initiator->write_message_1(payload_1, message));
    return message;
  }
  expected<PublicKey, HandshakeError> read_1(const Bytes& message) {
    Bytes payload(message.size() - message_1_size(0));
    auto key = responder->read_message_1(message, payload);
    if (key) {
      EXPECT_EQ(payload, payload_1);
    }
    return key;
  }
  Bytes write_2(std::size_t payload_size = 60) {
    payload_2 = random_bytes(random, payload_size);
    Bytes message(message_2_size(payload_size));
    EXPECT_TRUE(responder->write_message_2(random_pair(random), payload_2, message));
    return message;
  }
  expected<void, HandshakeError> read_2(const Bytes& message) {
    Bytes payload(message.size() - message_2_size(0));
    auto read = initiator->read_message_2(message, payload);
    if (read) {
      EXPECT_EQ(payload, payload_2);
    }
    return read;
  }

  Random random;
  KeyPair client_key;
  KeyPair server_key;
  std::optional<Initiator> initiator;
  std::optional<Responder> responder;
  Bytes payload_1;
  Bytes payload_2;
};

class HandshakeTest : public ::testing::TestWithParam<Suite> {
 protected:
  void SetUp() override {
    if ((suites_here() & static_cast<unsigned>(GetParam())) == 0) {
      GTEST_SKIP() << "this machine has no hardware for AES";
    }
  }
};
INSTANTIATE_TEST_SUITE_P(All, HandshakeTest, ::testing::Values(Suite::kChaChaPoly, Suite::kAesGcm),
                         [](const auto& suite) {
                           return suite.param == Suite::kAesGcm ? "AesGcm" : "ChaChaPoly";
                         });

TEST_P(HandshakeTest, GivesBothSidesTheSameKeysAndTheServerTheClientsKey) {
  Handshake handshake(GetParam());
  const auto client = handshake.read_1(handshake.write_1());
  ASSERT_TRUE(client);
  EXPECT_EQ(*client, handshake.client_key.public_key);
  ASSERT_TRUE(handshake.read_2(handshake.write_2()));
  const auto ours = handshake.initiator->keys();
  const auto theirs = handshake.responder->keys();
  ASSERT_TRUE(ours && theirs);
  EXPECT_TRUE(std::ranges::equal(ours->send.bytes(), theirs->receive.bytes()));
  EXPECT_TRUE(std::ranges::equal(ours->receive.bytes(), theirs->send.bytes()));
  EXPECT_FALSE(std::ranges::equal(ours->send.bytes(), ours->receive.bytes()));
  EXPECT_EQ(ours->handshake_hash, theirs->handshake_hash);
  EXPECT_FALSE(handshake.initiator->keys());
  EXPECT_FALSE(handshake.responder->keys());
}

TEST_P(HandshakeTest, RefusesAnyFlippedBitOfMessage1) {
  Handshake source(GetParam());
  const Bytes message = source.write_1(8);
  for (std::size_t bit = 0; bit < 8 * message.size(); bit += 3) {
    Handshake handshake(GetParam());
    Bytes flipped = message;
    flipped[bit / 8] ^= std::byte{1} << (bit % 8);
    // X25519 ignores the top bit of a public key, but the hash does not.
    EXPECT_FALSE(handshake.read_1(flipped)) << bit;
    Bytes answer(message_2_size(0));
    EXPECT_FALSE(handshake.responder->write_message_2(random_pair(handshake.random), {}, answer));
  }
}

// sec-3-4
TEST_P(HandshakeTest, KeepsWaitingAfterForgedMessages2) {
  Handshake handshake(GetParam());
  ASSERT_TRUE(handshake.read_1(handshake.write_1()));
  const Bytes message = handshake.write_2(8);
  for (std::size_t bit = 0; bit < 8 * message.size(); bit += 3) {
    Bytes flipped = message;
    flipped[bit / 8] ^= std::byte{1} << (bit % 8);
    EXPECT_FALSE(handshake.read_2(flipped)) << bit;
  }
  EXPECT_FALSE(handshake.read_2(Bytes(message_2_size(8))));
  EXPECT_FALSE(handshake.initiator->keys());
  ASSERT_TRUE(handshake.read_2(message));
  EXPECT_TRUE(handshake.initiator->keys());
}

TEST_P(HandshakeTest, RefusesAnotherPrologueServerSecretOrSuite) {
  Handshake handshake(GetParam());
  const Bytes message = handshake.write_1(0);
  const auto expect_refused = [&](Responder responder) {
    const auto read = responder.read_message_1(message, {});
    ASSERT_FALSE(read);
    EXPECT_EQ(read.error(), HandshakeError::kNotSealed);
  };
  expect_refused(Responder(GetParam(), handshake.server_key.clone(), Secret{}, {}));
  expect_refused(Responder(GetParam(), random_pair(handshake.random), Secret{}, kPrologue));
  for (const Suite other : all_suites()) {
    if (other == GetParam()) continue;
    expect_refused(Responder(other, handshake.server_key.clone(), Secret{}, kPrologue));
  }
  // Only message 2 reveals a different pre-shared key.
  handshake.responder.emplace(GetParam(), handshake.server_key.clone(),
                              random_secret(handshake.random), kPrologue);
  ASSERT_TRUE(handshake.responder->read_message_1(message, {}));
  EXPECT_FALSE(handshake.read_2(handshake.write_2()));
}

// sec-2-3
TEST_P(HandshakeTest, RefusesKeysOfSmallOrder) {
  Handshake handshake(GetParam());
  Initiator initiator(GetParam(), handshake.client_key.clone(), PublicKey{}, Secret{},
                      random_pair(handshake.random), kPrologue);
  Bytes message(message_1_size(0));
  const auto written = initiator.write_message_1({}, message);
  ASSERT_FALSE(written);
  EXPECT_EQ(written.error(), HandshakeError::kBadKey);
  const auto read = handshake.responder->read_message_1(Bytes(message_1_size(0)), {});
  ASSERT_FALSE(read);
  EXPECT_EQ(read.error(), HandshakeError::kBadKey);
}

// sec-3-1: an ephemeral key sends no second message.
TEST_P(HandshakeTest, RefusesMessagesOfWrongSizeOrOutOfTurn) {
  Handshake handshake(GetParam());
  Bytes message(message_1_size(4) - 1);
  EXPECT_EQ(handshake.initiator->write_message_1(Bytes(4), message).error(),
            HandshakeError::kBadSize);
  EXPECT_EQ(handshake.responder->read_message_1(Bytes(message_1_size(0) - 1), {}).error(),
            HandshakeError::kBadSize);
  EXPECT_EQ(handshake.initiator->read_message_2(Bytes(message_2_size(0)), {}).error(),
            HandshakeError::kOutOfTurn);
  const Bytes first = handshake.write_1();
  message.resize(message_1_size(4));
  EXPECT_EQ(handshake.initiator->write_message_1(Bytes(4), message).error(),
            HandshakeError::kOutOfTurn);
  ASSERT_TRUE(handshake.read_1(first));
  EXPECT_EQ(handshake.read_1(first).error(), HandshakeError::kOutOfTurn);
  EXPECT_EQ(handshake.responder->keys().error(), HandshakeError::kOutOfTurn);
}

// A server that gets the same message 1 twice creates different keys each time.
TEST_P(HandshakeTest, GivesOtherKeysForAReplayedMessage1) {
  Handshake handshake(GetParam());
  const Bytes message = handshake.write_1();
  ASSERT_TRUE(handshake.read_1(message));
  static_cast<void>(handshake.write_2());
  const auto first = handshake.responder->keys();
  handshake.responder.emplace(GetParam(), handshake.server_key.clone(), Secret{}, kPrologue);
  ASSERT_TRUE(handshake.read_1(message));
  static_cast<void>(handshake.write_2());
  const auto second = handshake.responder->keys();
  EXPECT_FALSE(std::ranges::equal(first->send.bytes(), second->send.bytes()));
  EXPECT_FALSE(std::ranges::equal(first->receive.bytes(), second->receive.bytes()));
}

}  // namespace
}  // namespace rtpm::crypto::test
