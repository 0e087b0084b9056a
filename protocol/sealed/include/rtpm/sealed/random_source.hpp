#pragma once

#include "rtpm/seal/primitives.hpp"

namespace rtpm::sealed {

/// The source of ephemeral keys. Only a simulation replaces the kernel's.
struct RandomSource {
  void (*fill)(void* context, MutableBytes bytes) = nullptr;
  void* context = nullptr;

  [[nodiscard]] seal::KeyPair draw_key() const noexcept {
    if (fill == nullptr) return seal::KeyPair::generate();
    seal::PrivateKey key;
    fill(context, key.bytes());
    return seal::KeyPair::of(std::move(key));
  }
};

}  // namespace rtpm::sealed
