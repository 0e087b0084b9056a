#pragma once

#include "rtpm/crypto/primitives.hpp"

namespace rtpm::sealed {

/// The source of ephemeral keys. Only simulations replace the kernel's.
struct RandomSource {
  void (*fill)(void* context, MutableBytes bytes) = nullptr;
  void* context = nullptr;

  [[nodiscard]] crypto::KeyPair draw_key() const noexcept {
    if (fill == nullptr) return crypto::KeyPair::generate();
    crypto::PrivateKey key;
    fill(context, key.bytes());
    return crypto::KeyPair::of(std::move(key));
  }
};

}  // namespace rtpm::sealed
