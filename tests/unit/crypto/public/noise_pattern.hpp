#pragma once

#include <sodium.h>

#include <map>
#include <sstream>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/crypto/symmetric_state.hpp"
#include "vectors.hpp"

/// Any Noise pattern, played by both sides on RTPM's symmetric state.
namespace rtpm::crypto::test {

/// HMAC's usual construction, for hashes that libsodium has without HMAC.
template <class Plain, std::size_t kBlockSize>
struct WithHmac : Plain {
  using Value = typename Plain::Value;
  static void hmac(ConstBytes key, ConstBytes first, ConstBytes second, Value& out) {
    std::array<std::byte, kBlockSize> inner{};
    std::array<std::byte, kBlockSize> outer{};
    std::ranges::copy(key, inner.begin());
    outer = inner;
    for (std::byte& byte : inner)
      byte ^= std::byte{0x36};
    for (std::byte& byte : outer)
      byte ^= std::byte{0x5c};
    Bytes text(inner.begin(), inner.end());
    text.insert(text.end(), first.begin(), first.end());
    text.insert(text.end(), second.begin(), second.end());
    out = Plain::hash(outer, Plain::hash(text, {}));
  }
};

struct PlainSha512 {
  static constexpr std::size_t kSize = 64;
  using Value = std::array<std::byte, kSize>;
  static Value hash(ConstBytes first, ConstBytes second) {
    Bytes text(first.begin(), first.end());
    text.insert(text.end(), second.begin(), second.end());
    Value value;
    crypto_hash_sha512(reinterpret_cast<unsigned char*>(value.data()),
                       reinterpret_cast<const unsigned char*>(text.data()), text.size());
    return value;
  }
};
using Sha512 = WithHmac<PlainSha512, 128>;

struct PlainBlake2b {
  static constexpr std::size_t kSize = 64;
  using Value = std::array<std::byte, kSize>;
  static Value hash(ConstBytes first, ConstBytes second) {
    Bytes text(first.begin(), first.end());
    text.insert(text.end(), second.begin(), second.end());
    Value value;
    crypto_generichash(reinterpret_cast<unsigned char*>(value.data()), value.size(),
                       reinterpret_cast<const unsigned char*>(text.data()), text.size(), nullptr,
                       0);
    return value;
  }
};
using Blake2b = WithHmac<PlainBlake2b, 128>;

/// A pattern: the keys known in advance, and the tokens of each message.
struct Pattern {
  bool knows_initiator = false;
  bool knows_responder = false;
  bool is_one_way = false;
  std::vector<std::vector<std::string>> messages;
};

/// The messages of the patterns without `psk` (Noise, 7.4, 7.5 and 18.1): "e, es | e, ee".
inline const std::map<std::string, std::string>& patterns() {
  static const std::map<std::string, std::string> kPatterns{
      {"N", "e es"},
      {"K", "e es ss"},
      {"X", "e es s ss"},
      {"NN", "e | e ee"},
      {"NK", "e es | e ee"},
      {"NX", "e | e ee s es"},
      {"KN", "e | e ee se"},
      {"KK", "e es ss | e ee se"},
      {"KX", "e | e ee se s es"},
      {"XN", "e | e ee | s se"},
      {"XK", "e es | e ee | s se"},
      {"XX", "e | e ee s es | s se"},
      {"IN", "e s | e ee se"},
      {"IK", "e es s ss | e ee se"},
      {"IX", "e s | e ee se s es"},
      {"NK1", "e | e ee es"},
      {"NX1", "e | e ee s | es"},
      {"X1N", "e | e ee | s | se"},
      {"X1K", "e es | e ee | s | se"},
      {"XK1", "e | e ee es | s se"},
      {"X1K1", "e | e ee es | s | se"},
      {"X1X", "e | e ee s es | s | se"},
      {"XX1", "e | e ee s | es s se"},
      {"X1X1", "e | e ee s | es s | se"},
      {"K1N", "e | e ee | se"},
      {"K1K", "e es | e ee | se"},
      {"KK1", "e | e ee se es"},
      {"K1K1", "e | e ee es | se"},
      {"K1X", "e | e ee s es | se"},
      {"KX1", "e | e ee se s | es"},
      {"K1X1", "e | e ee s | se es"},
      {"I1N", "e s | e ee | se"},
      {"I1K", "e es s | e ee | se"},
      {"IK1", "e s | e ee se es"},
      {"I1K1", "e s | e ee es | se"},
      {"I1X", "e s | e ee s es | se"},
      {"IX1", "e s | e ee se s | es"},
      {"I1X1", "e s | e ee s | se es"},
  };
  return kPatterns;
}

/// The pattern with a name such as "IKpsk2" or "NNpsk0".
inline Pattern pattern_named(const std::string& name) {
  const std::size_t psk = name.find("psk");
  const std::string plain = name.substr(0, psk);
  Pattern pattern;
  pattern.is_one_way = plain.size() == 1;
  pattern.knows_initiator = plain.front() == 'K' || plain == "K";
  const std::string last = plain.substr(plain.back() == '1' ? plain.size() - 2 : plain.size() - 1);
  pattern.knows_responder = pattern.is_one_way || last.front() == 'K';
  std::istringstream tokens(patterns().at(plain));
  pattern.messages.emplace_back();
  for (std::string token; tokens >> token;) {
    if (token == "|") {
      pattern.messages.emplace_back();
    } else {
      pattern.messages.back().push_back(token);
    }
  }
  if (psk == std::string::npos) return pattern;
  const auto position = static_cast<std::size_t>(name[psk + 3] - '0');
  if (position == 0) {
    pattern.messages.front().insert(pattern.messages.front().begin(), "psk");
  } else {
    pattern.messages[position - 1].emplace_back("psk");
  }
  return pattern;
}

/// One side of a handshake with any pattern.
template <class Hash>
class PatternSide {
 public:
  PatternSide(const NoiseVector& vector, const Pattern& pattern, Suite suite, bool is_initiator)
      : pattern_(pattern),
        is_initiator_(is_initiator),
        preshared_(vector.preshared),
        symmetric_(vector.protocol_name, suite) {
    const auto pair_of = [](const std::optional<Bytes>& key) {
      return key ? KeyPair::of(Secret(std::span<const std::byte, kKeySize>(*key))) : KeyPair{};
    };
    const KeyPair initiator = pair_of(vector.initiator_static);
    const KeyPair responder = pair_of(vector.responder_static);
    own_ = (is_initiator ? initiator : responder).clone();
    ephemeral_ = pair_of(is_initiator ? vector.initiator_ephemeral : vector.responder_ephemeral);
    symmetric_.mix_hash(vector.prologue);
    if (pattern.knows_initiator) symmetric_.mix_hash(initiator.public_key);
    if (pattern.knows_responder) symmetric_.mix_hash(responder.public_key);
    if (is_initiator && pattern.knows_responder) their_static_ = responder.public_key;
    if (!is_initiator && pattern.knows_initiator) their_static_ = initiator.public_key;
  }

  Bytes write(std::size_t number, const Bytes& payload) {
    Bytes message;
    for (const std::string& token : pattern_.messages[number]) {
      if (token == "e") {
        message.insert(message.end(), ephemeral_.public_key.begin(), ephemeral_.public_key.end());
        mix_ephemeral(ephemeral_.public_key);
      } else if (token == "s") {
        encrypt(own_.public_key, message);
      } else {
        mix(token);
      }
    }
    encrypt(payload, message);
    return message;
  }

  std::optional<Bytes> read(std::size_t number, const Bytes& message) {
    ConstBytes left = message;
    for (const std::string& token : pattern_.messages[number]) {
      if (token == "e") {
        std::ranges::copy(left.first(kKeySize), their_ephemeral_.begin());
        left = left.subspan(kKeySize);
        mix_ephemeral(their_ephemeral_);
      } else if (token == "s") {
        const std::size_t size = kKeySize + symmetric_.overhead();
        if (!symmetric_.decrypt_and_hash(left.first(size), their_static_)) return std::nullopt;
        left = left.subspan(size);
      } else {
        mix(token);
      }
    }
    Bytes payload(left.size() - symmetric_.overhead());
    if (!symmetric_.decrypt_and_hash(left, payload)) return std::nullopt;
    return payload;
  }

  SymmetricState<Hash>& symmetric() { return symmetric_; }

 private:
  void encrypt(ConstBytes plain, Bytes& message) {
    Bytes sealed(plain.size() + symmetric_.overhead());
    symmetric_.encrypt_and_hash(plain, sealed);
    message.insert(message.end(), sealed.begin(), sealed.end());
  }
  void mix_ephemeral(const PublicKey& key) {
    symmetric_.mix_hash(key);
    if (!preshared_.empty()) symmetric_.mix_key(key);
  }
  // "ee", "es", "se", "ss" or "psk": the first letter is the initiator's key.
  void mix(const std::string& token) {
    if (token == "psk") {
      symmetric_.mix_key_and_hash(preshared_.at(preshared_taken_++));
      return;
    }
    const char ours = token[is_initiator_ ? 0 : 1];
    const char theirs = token[is_initiator_ ? 1 : 0];
    Secret shared;
    static_cast<void>(agree((ours == 'e' ? ephemeral_ : own_).private_key,
                            theirs == 'e' ? their_ephemeral_ : their_static_, shared));
    symmetric_.mix_key(shared.bytes());
  }

  Pattern pattern_;
  bool is_initiator_;
  KeyPair own_;
  KeyPair ephemeral_;
  PublicKey their_static_{};
  PublicKey their_ephemeral_{};
  std::vector<Bytes> preshared_;
  std::size_t preshared_taken_ = 0;
  SymmetricState<Hash> symmetric_;
};

}  // namespace rtpm::crypto::test
