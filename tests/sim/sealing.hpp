#pragma once

#include <cstdint>
#include <map>
#include <set>
#include <utility>

#include "history.hpp"
#include "rtpm/sealed/client.hpp"
#include "rtpm/sealed/server.hpp"
#include "scheduler.hpp"

namespace rtpm::sim {

/// The keys of a conversation with sealed sessions, and a check of every sealed frame: no key may
/// seal two frames under one counter.
class Sealing : public sealed::Admission {
 public:
  Sealing(Random& random, History& history) : random_(random), history_(history) {
    identity_.random = source();
    identity_.key = source().draw_key();
    if (random.chance(300)) source().fill(&random_, identity_.preshared.bytes());
    // Not all machines have hardware for AES.
    if (random.chance(300)) identity_.suites = 1;
    // Few frames per key, so that keys change all the time.
    limits_.generation_bits = random.chance(500) ? 10 : 22;
  }

  [[nodiscard]] sealed::RandomSource source() {
    return {[](void* random, MutableBytes bytes) {
              for (std::byte& byte : bytes) {
                byte = static_cast<std::byte>(static_cast<Random*>(random)->between(0, 255));
              }
            },
            &random_};
  }
  [[nodiscard]] const sealed::ServerIdentity& identity() const { return identity_; }
  [[nodiscard]] const crypto::SessionLimits& limits() const { return limits_; }
  /// The key of a client, which stays the same when it restarts.
  [[nodiscard]] const crypto::KeyPair& client_key(std::uint32_t number) {
    return clients_.try_emplace(number, source().draw_key()).first->second;
  }
  [[nodiscard]] bool admits(const crypto::PublicKey& client,
                            const wire::PeerAddress&) noexcept override {
    for (const auto& [number, key] : clients_) {
      if (key.public_key == client) return !revoked_.contains(number);
    }
    return false;
  }
  /// Revokes the grant of a client, or restores it.
  void set_revoked(std::uint32_t number, bool is_revoked) {
    is_revoked ? void(revoked_.insert(number)) : void(revoked_.erase(number));
  }

  /// Checks a frame that one side hands to its transport.
  void on_sent(MonotonicTime now, bool is_client, ConstBytes frame) {
    const auto kind = std::to_integer<unsigned>(frame[3]);
    const bool is_handshake = kind <= static_cast<unsigned>(wire::FrameKind::kRefuse);
    if (!wire::is_sealed(frame)) {
      if (!is_handshake) history_.broken(now, "a frame left a sealed session unsealed");
      return;
    }
    const auto session = load_le<std::uint64_t>(frame.data() + 8);
    const auto counter = load_le<std::uint64_t>(frame.data() + frame.size() - crypto::kTrailerSize);
    ++sealed_count_;
    if (counter >> limits_.generation_bits > 0) ++later_key_count_;
    if (!used_.emplace(session, is_client, counter).second) {
      history_.broken(now, "a key sealed two frames under one counter");
    }
  }
  [[nodiscard]] std::uint64_t sealed_count() const { return sealed_count_; }
  [[nodiscard]] std::uint64_t later_key_count() const { return later_key_count_; }

 private:
  Random& random_;
  History& history_;
  sealed::ServerIdentity identity_;
  crypto::SessionLimits limits_{};
  std::map<std::uint32_t, crypto::KeyPair> clients_;
  std::set<std::uint32_t> revoked_;
  std::set<std::tuple<std::uint64_t, bool, std::uint64_t>> used_;
  std::uint64_t sealed_count_ = 0;
  std::uint64_t later_key_count_ = 0;
};

}  // namespace rtpm::sim
