#include <gtest/gtest.h>

#include "noise_pattern.hpp"
#include "rtpm/crypto/handshake.hpp"

namespace rtpm::crypto::test {
namespace {

/// The parts of "Noise_IKpsk2_25519_AESGCM_SHA256".
struct Name {
  explicit Name(const std::string& text) {
    std::istringstream parts(text);
    std::string noise;
    std::getline(parts, noise, '_');
    std::getline(parts, pattern, '_');
    std::getline(parts, curve, '_');
    std::getline(parts, cipher, '_');
    std::getline(parts, hash, '_');
  }
  [[nodiscard]] Suite suite() const {
    return cipher == "AESGCM" ? Suite::kAesGcm : Suite::kChaChaPoly;
  }
  std::string pattern, curve, cipher, hash;
};

Bytes sealed_by(const AeadKey& key, std::uint64_t number, const Bytes& plain) {
  Bytes sealed(plain.size() + kTagSize);
  key.seal(number, {}, plain, MutableBytes(sealed).first(plain.size()),
           std::span<std::byte, kTagSize>(sealed.data() + plain.size(), kTagSize));
  return sealed;
}

template <class Hash>
void expect_plays(const NoiseVector& vector) {
  const Name name(vector.protocol_name);
  const Pattern pattern = pattern_named(name.pattern);
  PatternSide<Hash> initiator(vector, pattern, name.suite(), true);
  PatternSide<Hash> responder(vector, pattern, name.suite(), false);
  const std::size_t count = pattern.messages.size();
  for (std::size_t i = 0; i < count; ++i) {
    const NoiseMessage& message = vector.messages.at(i);
    auto& writer = i % 2 == 0 ? initiator : responder;
    auto& reader = i % 2 == 0 ? responder : initiator;
    ASSERT_EQ(writer.write(i, message.payload), message.ciphertext) << "message " << i;
    ASSERT_EQ(reader.read(i, message.ciphertext), message.payload) << "message " << i;
  }
  if (!vector.handshake_hash.empty()) {
    EXPECT_TRUE(std::ranges::equal(initiator.symmetric().handshake_hash(), vector.handshake_hash));
  }
  Secret first, second;
  initiator.symmetric().split(first, second);
  std::array<AeadKey, 2> keys;
  keys[0].set(name.suite(), first);
  keys[1].set(name.suite(), second);
  std::array<std::uint64_t, 2> numbers{};
  for (std::size_t i = count; i < vector.messages.size(); ++i) {
    const std::size_t turn = vector.initiator_begins_transport ? i - count : i;
    const std::size_t side =
        pattern.is_one_way && !vector.initiator_begins_transport ? 0 : turn % 2;
    EXPECT_EQ(sealed_by(keys[side], numbers[side]++, vector.messages[i].payload),
              vector.messages[i].ciphertext)
        << "message " << i;
  }
}

// RTPM's own objects, which know one pattern, must give the same results that the interpreter above
// proves for the symmetric state.
void expect_plays_ours(const NoiseVector& vector) {
  const Suite suite = Name(vector.protocol_name).suite();
  const auto secret = [](const Bytes& bytes) {
    return Secret(std::span<const std::byte, kKeySize>(bytes));
  };
  const KeyPair server = KeyPair::of(secret(*vector.responder_static));
  Initiator initiator(suite, KeyPair::of(secret(*vector.initiator_static)), server.public_key,
                      secret(vector.preshared.at(0)),
                      KeyPair::of(secret(*vector.initiator_ephemeral)), vector.prologue);
  Responder responder(suite, server.clone(), secret(vector.preshared.at(0)), vector.prologue);
  const NoiseMessage& one = vector.messages.at(0);
  Bytes message(message_1_size(one.payload.size()));
  ASSERT_TRUE(initiator.write_message_1(one.payload, message));
  EXPECT_EQ(message, one.ciphertext);
  Bytes payload(one.payload.size());
  ASSERT_TRUE(responder.read_message_1(message, payload));
  EXPECT_EQ(payload, one.payload);
  const NoiseMessage& two = vector.messages.at(1);
  message.resize(message_2_size(two.payload.size()));
  ASSERT_TRUE(responder.write_message_2(KeyPair::of(secret(*vector.responder_ephemeral)),
                                        two.payload, message));
  EXPECT_EQ(message, two.ciphertext);
  payload.resize(two.payload.size());
  ASSERT_TRUE(initiator.read_message_2(message, payload));
  EXPECT_EQ(payload, two.payload);
  const auto keys = initiator.keys();
  const auto their_keys = responder.keys();
  ASSERT_TRUE(keys && their_keys);
  AeadKey send, receive;
  send.set(suite, keys->send);
  receive.set(suite, their_keys->send);
  const std::size_t by_initiator = 2, by_responder = 3;
  EXPECT_EQ(sealed_by(send, 0, vector.messages.at(by_initiator).payload),
            vector.messages.at(by_initiator).ciphertext);
  EXPECT_EQ(sealed_by(receive, 0, vector.messages.at(by_responder).payload),
            vector.messages.at(by_responder).ciphertext);
  if (vector.handshake_hash.empty()) return;
  EXPECT_TRUE(std::ranges::equal(keys->handshake_hash, vector.handshake_hash));
  EXPECT_TRUE(std::ranges::equal(their_keys->handshake_hash, vector.handshake_hash));
}

// The number of vectors played, and of those skipped, by reason.
using Counts = std::map<std::string, int>;

Counts play(const std::vector<NoiseVector>& vectors) {
  Counts counts;
  for (const NoiseVector& vector : vectors) {
    SCOPED_TRACE(vector.protocol_name);
    const Name name(vector.protocol_name);
    if (name.curve != "25519") {
      ++counts["curve " + name.curve];
    } else if (name.hash == "BLAKE2s") {
      ++counts["hash BLAKE2s"];
    } else if ((suites_here() & static_cast<unsigned>(name.suite())) == 0) {
      ++counts["no AES hardware"];
    } else {
      ++counts["played"];
      if (name.hash == "SHA256") expect_plays<Sha256>(vector);
      if (name.hash == "SHA512") expect_plays<Sha512>(vector);
      if (name.hash == "BLAKE2b") expect_plays<Blake2b>(vector);
      if (vector.protocol_name == protocol_name(name.suite())) {
        ++counts["played with RTPM's handshake"];
        expect_plays_ours(vector);
      }
    }
  }
  for (const auto& [what, count] : counts)
    ::testing::Test::RecordProperty(what, count);
  return counts;
}

bool has_aes() {
  return (suites_here() & static_cast<unsigned>(Suite::kAesGcm)) != 0;
}

TEST(PublicNoiseVectors, OfCacophonyAreReproduced) {
  const auto vectors = read_cacophony();
  if (!vectors) GTEST_SKIP() << "RTPM_PUBLIC_VECTORS has no cacophony.txt, see tests/unit/crypto";
  Counts counts = play(*vectors);
  // 59 patterns; libsodium does not have the curve 448 or BLAKE2s.
  EXPECT_EQ(counts["played"], has_aes() ? 59 * 6 : 59 * 3);
  EXPECT_EQ(counts["played with RTPM's handshake"], has_aes() ? 2 : 1);
  EXPECT_EQ(counts["curve 448"], 59 * 8);
  EXPECT_EQ(counts["hash BLAKE2s"], 59 * 2);
}

TEST(PublicNoiseVectors, OfFlynnAreReproduced) {
  const auto vectors = read_flynn();
  if (!vectors) GTEST_SKIP() << "needs the Debian package golang-github-flynn-noise-dev";
  Counts counts = play(*vectors);
  EXPECT_EQ(counts["played"], has_aes() ? 1440 : 720);
  EXPECT_EQ(counts["played with RTPM's handshake"], has_aes() ? 8 : 4);
}

}  // namespace
}  // namespace rtpm::crypto::test
