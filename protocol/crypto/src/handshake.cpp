#include "rtpm/crypto/handshake.hpp"

#include <utility>

namespace rtpm::crypto {
namespace {

using Symmetric = SymmetricState<Sha256>;

PublicKey key_at(ConstBytes message, std::size_t offset) noexcept {
  PublicKey key;
  std::ranges::copy(message.subspan(offset, kKeySize), key.begin());
  return key;
}

// Noise, 7.1: a DH token. sec-2-3: the shared secret with a point of small order is public.
[[nodiscard]] bool mix_shared(Symmetric& symmetric, const PrivateKey& ours,
                              const PublicKey& theirs) noexcept {
  Secret shared;
  if (!agree(ours, theirs, shared)) return false;
  symmetric.mix_key(shared.bytes());
  return true;
}

// Noise, 9.2: with a pre-shared key, `e` is mixed into the key as well as the hash.
void mix_ephemeral(Symmetric& symmetric, const PublicKey& ephemeral) noexcept {
  symmetric.mix_hash(ephemeral);
  symmetric.mix_key(ephemeral);
}

[[nodiscard]] unexpected<HandshakeError> fail(HandshakeError error) noexcept {
  return unexpected{error};
}

}  // namespace

std::string_view to_string(HandshakeError error) noexcept {
  switch (error) {
    case HandshakeError::kBadSize:
      return "bad size";
    case HandshakeError::kBadKey:
      return "bad key";
    case HandshakeError::kNotSealed:
      return "not sealed";
    case HandshakeError::kOutOfTurn:
      return "out of turn";
  }
  return "unknown";
}

std::string_view protocol_name(Suite suite) noexcept {
  return suite == Suite::kAesGcm ? "Noise_IKpsk2_25519_AESGCM_SHA256"
                                 : "Noise_IKpsk2_25519_ChaChaPoly_SHA256";
}

Initiator::Initiator(Suite suite, KeyPair own, const PublicKey& server, PresharedKey preshared,
                     KeyPair ephemeral, ConstBytes prologue) noexcept
    : suite_(suite),
      own_(std::move(own)),
      ephemeral_(std::move(ephemeral)),
      server_(server),
      preshared_(std::move(preshared)),
      symmetric_(protocol_name(suite), suite) {
  symmetric_.mix_hash(prologue);
  symmetric_.mix_hash(server_);
}

// -> e, es, s, ss. sec-3-1: only once, so that an ephemeral key serves one message.
expected<void, HandshakeError> Initiator::write_message_1(ConstBytes payload,
                                                          MutableBytes out) noexcept {
  if (state_ != State::kFresh) return fail(HandshakeError::kOutOfTurn);
  if (out.size() != message_1_size(payload.size())) return fail(HandshakeError::kBadSize);
  state_ = State::kOver;
  std::ranges::copy(ephemeral_.public_key, out.begin());
  mix_ephemeral(symmetric_, ephemeral_.public_key);
  if (!mix_shared(symmetric_, ephemeral_.private_key, server_)) {
    return fail(HandshakeError::kBadKey);
  }
  symmetric_.encrypt_and_hash(own_.public_key, out.subspan(kKeySize, kKeySize + kTagSize));
  if (!mix_shared(symmetric_, own_.private_key, server_)) return fail(HandshakeError::kBadKey);
  symmetric_.encrypt_and_hash(payload, out.subspan(message_1_size(0) - kTagSize));
  state_ = State::kSent;
  return {};
}

// <- e, ee, se, psk. sec-3-4: tried on a copy, as any host may have sent it.
expected<void, HandshakeError> Initiator::read_message_2(ConstBytes message,
                                                         MutableBytes payload) noexcept {
  if (state_ != State::kSent) return fail(HandshakeError::kOutOfTurn);
  if (message.size() != message_2_size(payload.size())) return fail(HandshakeError::kBadSize);
  const PublicKey ephemeral = key_at(message, 0);
  Symmetric trial(protocol_name(suite_), suite_);
  trial.copy_from(symmetric_);
  mix_ephemeral(trial, ephemeral);
  if (!mix_shared(trial, ephemeral_.private_key, ephemeral) ||
      !mix_shared(trial, own_.private_key, ephemeral)) {
    return fail(HandshakeError::kBadKey);
  }
  trial.mix_key_and_hash(preshared_.bytes());
  if (!trial.decrypt_and_hash(message.subspan(kKeySize), payload)) {
    return fail(HandshakeError::kNotSealed);
  }
  symmetric_.copy_from(trial);
  state_ = State::kDone;
  wipe(ephemeral_.private_key.bytes());
  return {};
}

expected<SessionKeys, HandshakeError> Initiator::keys() noexcept {
  if (state_ != State::kDone) return fail(HandshakeError::kOutOfTurn);
  state_ = State::kOver;
  SessionKeys keys;
  keys.suite = suite_;
  symmetric_.split(keys.send, keys.receive);
  keys.handshake_hash = symmetric_.handshake_hash();
  return keys;
}

Responder::Responder(Suite suite, KeyPair own, PresharedKey preshared, ConstBytes prologue) noexcept
    : suite_(suite),
      own_(std::move(own)),
      preshared_(std::move(preshared)),
      symmetric_(protocol_name(suite), suite) {
  symmetric_.mix_hash(prologue);
  symmetric_.mix_hash(own_.public_key);
}

expected<PublicKey, HandshakeError> Responder::read_message_1(ConstBytes message,
                                                              MutableBytes payload) noexcept {
  if (state_ != State::kFresh) return fail(HandshakeError::kOutOfTurn);
  if (message.size() != message_1_size(payload.size())) return fail(HandshakeError::kBadSize);
  state_ = State::kOver;
  client_ephemeral_ = key_at(message, 0);
  mix_ephemeral(symmetric_, client_ephemeral_);
  if (!mix_shared(symmetric_, own_.private_key, client_ephemeral_)) {
    return fail(HandshakeError::kBadKey);
  }
  if (!symmetric_.decrypt_and_hash(message.subspan(kKeySize, kKeySize + kTagSize), client_)) {
    return fail(HandshakeError::kNotSealed);
  }
  if (!mix_shared(symmetric_, own_.private_key, client_)) return fail(HandshakeError::kBadKey);
  if (!symmetric_.decrypt_and_hash(message.subspan(message_1_size(0) - kTagSize), payload)) {
    return fail(HandshakeError::kNotSealed);
  }
  state_ = State::kReceived;
  return client_;
}

expected<void, HandshakeError> Responder::write_message_2(KeyPair ephemeral, ConstBytes payload,
                                                          MutableBytes out) noexcept {
  if (state_ != State::kReceived) return fail(HandshakeError::kOutOfTurn);
  if (out.size() != message_2_size(payload.size())) return fail(HandshakeError::kBadSize);
  state_ = State::kOver;
  std::ranges::copy(ephemeral.public_key, out.begin());
  mix_ephemeral(symmetric_, ephemeral.public_key);
  if (!mix_shared(symmetric_, ephemeral.private_key, client_ephemeral_) ||
      !mix_shared(symmetric_, ephemeral.private_key, client_)) {
    return fail(HandshakeError::kBadKey);
  }
  symmetric_.mix_key_and_hash(preshared_.bytes());
  symmetric_.encrypt_and_hash(payload, out.subspan(kKeySize));
  state_ = State::kDone;
  return {};
}

expected<SessionKeys, HandshakeError> Responder::keys() noexcept {
  if (state_ != State::kDone) return fail(HandshakeError::kOutOfTurn);
  state_ = State::kOver;
  SessionKeys keys;
  keys.suite = suite_;
  symmetric_.split(keys.receive, keys.send);
  keys.handshake_hash = symmetric_.handshake_hash();
  return keys;
}

}  // namespace rtpm::crypto
