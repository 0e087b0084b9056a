#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

/// Public test vectors as plain values. Their files are not part of this tree: see README.md beside
/// this file's folder.
namespace rtpm::crypto::test {

using Bytes = std::vector<std::byte>;

[[nodiscard]] Bytes bytes_of_hex(const std::string& hex);

struct NoiseMessage {
  Bytes payload;
  Bytes ciphertext;
};

/// A handshake with all its keys and its messages.
struct NoiseVector {
  std::string protocol_name;  ///< "Noise_IKpsk2_25519_AESGCM_SHA256"
  Bytes prologue;
  std::optional<Bytes> initiator_static;
  std::optional<Bytes> initiator_ephemeral;
  std::optional<Bytes> responder_static;
  std::optional<Bytes> responder_ephemeral;
  std::vector<Bytes> preshared;
  Bytes handshake_hash;  ///< Empty if not given.
  std::vector<NoiseMessage> messages;
  /// Whether the initiator sends the first transport message, whichever side sent last.
  bool initiator_begins_transport = false;
};

struct KeyAgreementVector {
  int id = 0;
  Bytes public_key;
  Bytes private_key;
  Bytes shared;
};

struct SealVector {
  int id = 0;
  bool is_valid = false;
  std::size_t key_bits = 0;
  std::size_t nonce_bits = 0;
  Bytes key;
  Bytes nonce;
  Bytes associated;
  Bytes plain;
  Bytes sealed;
  Bytes tag;
};

/// Returns nullopt if the file is not on this machine.
[[nodiscard]] std::optional<std::vector<NoiseVector>> read_cacophony();
[[nodiscard]] std::optional<std::vector<NoiseVector>> read_flynn();
[[nodiscard]] std::optional<std::vector<KeyAgreementVector>> read_key_agreement();
/// @param file  "aes_gcm_test.json", …
[[nodiscard]] std::optional<std::vector<SealVector>> read_seals(const std::string& file);

}  // namespace rtpm::crypto::test
