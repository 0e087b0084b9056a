#pragma once

#include <random>
#include <vector>

#include "rtpm/crypto/handshake.hpp"
#include "rtpm/crypto/session.hpp"

namespace rtpm::crypto::test {

using Bytes = std::vector<std::byte>;
using Random = std::mt19937_64;

inline Bytes random_bytes(Random& random, std::size_t size) {
  Bytes bytes(size);
  for (std::byte& byte : bytes)
    byte = static_cast<std::byte>(random());
  return bytes;
}
inline Secret random_secret(Random& random) {
  return Secret(std::span<const std::byte, kKeySize>(random_bytes(random, kKeySize)));
}
inline KeyPair random_pair(Random& random) {
  return KeyPair::of(random_secret(random));
}

/// Both suites, or the only one that this machine supports.
inline std::vector<Suite> all_suites() {
  std::vector<Suite> suites{Suite::kChaChaPoly};
  if (best_suite(suites_here(), suites_here()) == Suite::kAesGcm) suites.push_back(Suite::kAesGcm);
  return suites;
}

/// The keys of a client and its server, as a handshake would give them.
struct KeysOfBoth {
  SessionKeys client;
  SessionKeys server;
};
inline KeysOfBoth keys_of_both(Suite suite, Random& random) {
  const Secret up = random_secret(random);
  const Secret down = random_secret(random);
  KeysOfBoth keys;
  keys.client = {suite, up.clone(), down.clone(), {}};
  keys.server = {suite, down.clone(), up.clone(), {}};
  return keys;
}

}  // namespace rtpm::crypto::test
