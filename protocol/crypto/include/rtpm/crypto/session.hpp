#pragma once

#include <array>
#include <cstdint>
#include <string_view>

#include "rtpm/base/expected.hpp"
#include "rtpm/crypto/handshake.hpp"
#include "rtpm/crypto/replay_window.hpp"

namespace rtpm::crypto {

/// The size of the trailer after a frame's sealed payload: counter and tag.
inline constexpr std::size_t kTrailerSize = 8 + kTagSize;

/// The bounds of a session.
/// @source   spec/security.md#sec-5
struct SessionLimits {
  unsigned generation_bits = 22;  ///< A key seals 2 to the power of this many frames.
  std::uint64_t counter_end = std::uint64_t{1} << 48;  ///< The first counter that is never used.
  std::uint64_t forged_max = std::uint64_t{1} << 36;   ///< How many forged frames end the session.
};

/// In which order frames reach the other side.
enum class Order : std::uint8_t {
  kAny,    ///< Datagrams: may be lost, repeated or reordered.
  kExact,  ///< A stream: each counter is one more than the last.
};

/// Why a frame was not sealed.
enum class SealError : std::uint8_t {
  /// The session reached a limit, was ended, or its memory was wiped, for example by a fork.
  kEnded,
  kBadSize,  ///< The frame's buffer has the wrong size.
};

/// Why a frame was not opened. Only a counter has changed.
enum class OpenError : std::uint8_t {
  kEnded,     ///< Like SealError::kEnded.
  kTooShort,  ///< Too short for header, counter and tag.
  kReplayed,  ///< Received before, older than the window, or out of order on a stream.
  /// Uses an expired key, a key more than one generation ahead, or a counter without a key.
  kBeyond,
  kForged,  ///< Not sealed by the other side of this session, or modified in transit.
};
[[nodiscard]] std::string_view to_string(OpenError error) noexcept;

/// Seals and opens the frames of one session, for one side. A sealed frame is
/// header | sealed payload | counter, 8 bytes | tag, 16 bytes; the header is authenticated.
/// @ownership never copied or moved: two copies would reuse counters. In memory that is wiped on
///            fork (MADV_WIPEONFORK) a child's session has ended
/// @realtime  alloc-free; a call's frame takes 200 ns with AES hardware, 500 ns without
class SealedSession {
 public:
  SealedSession(const SessionKeys& keys, Order order, const SessionLimits& limits = {}) noexcept;
  SealedSession(const SealedSession&) = delete;
  SealedSession& operator=(const SealedSession&) = delete;
  ~SealedSession() { end(); }

  /// Writes the sealed frame and uses up a counter. Call it for each frame passed to the transport,
  /// including repetitions and fragments, when it is sent.
  /// @param header   authenticated, not sealed
  /// @param payload  at its position after the header in `out`, or not overlapping it
  /// @param out      header.size() + payload.size() + kTrailerSize bytes
  [[nodiscard]] expected<void, SealError> seal(ConstBytes header, ConstBytes payload,
                                               MutableBytes out) noexcept;
  /// Checks a received frame, and opens its payload in place.
  /// @param frame  as received, including the header; unspecified after kForged
  /// @return the payload, a view of `frame`
  [[nodiscard]] expected<ConstBytes, OpenError> open(std::size_t header_size,
                                                     MutableBytes frame) noexcept;
  /// Wipes the keys. No frame can be sealed or opened after that.
  void end() noexcept;

  [[nodiscard]] bool has_ended() const noexcept { return is_alive_ == 0; }
  /// Whether an authentic frame was received: only this proves that the other side takes part now.
  [[nodiscard]] bool is_confirmed() const noexcept { return window_.next() != 0; }
  /// The counter of the next frame to be sealed.
  [[nodiscard]] std::uint64_t send_counter() const noexcept { return send_counter_; }
  [[nodiscard]] std::uint64_t forged_count() const noexcept { return forged_count_; }
  /// Public; unique for each handshake.
  [[nodiscard]] const Digest& handshake_hash() const noexcept { return handshake_hash_; }

 private:
  [[nodiscard]] std::uint64_t generation_of(std::uint64_t counter) const noexcept {
    return counter >> limits_.generation_bits;
  }
  [[nodiscard]] AeadKey& receive_key(std::uint64_t generation) noexcept {
    return receive_keys_[generation % receive_keys_.size()];
  }
  [[nodiscard]] expected<void, OpenError> judge(std::uint64_t counter) const noexcept;
  void advance_send() noexcept;
  void accept(std::uint64_t counter) noexcept;

  // Nonzero while the session lives; a wiped page makes it zero.
  std::uint64_t is_alive_ = 0;
  SessionLimits limits_;
  Order order_;
  std::uint64_t send_counter_ = 0;
  std::uint64_t receive_generation_ = 0;  ///< The generation of the largest counter received.
  std::uint64_t forged_count_ = 0;
  ReplayWindow window_;
  Digest handshake_hash_;
  std::array<AeadKey, 2> send_keys_;  ///< The keys of the current generation and the next.
  /// The keys of the previous, the current and the next generation.
  std::array<AeadKey, 3> receive_keys_;
};

}  // namespace rtpm::crypto
