#include "rtpm/crypto/session.hpp"

#include "rtpm/base/assert.hpp"

namespace rtpm::crypto {

std::string_view to_string(OpenError error) noexcept {
  switch (error) {
    case OpenError::kEnded:
      return "ended";
    case OpenError::kTooShort:
      return "too short";
    case OpenError::kReplayed:
      return "replayed";
    case OpenError::kBeyond:
      return "beyond";
    case OpenError::kForged:
      return "forged";
  }
  return "unknown";
}

SealedSession::SealedSession(const SessionKeys& keys, Order order,
                             const SessionLimits& limits) noexcept
    : is_alive_(1), limits_(limits), order_(order), handshake_hash_(keys.handshake_hash) {
  RTPM_ASSERT((std::uint64_t{1} << limits.generation_bits) >= ReplayWindow::kSize,
              "a window of counters has at most two keys");
  send_keys_[0].set(keys.suite, keys.send);
  send_keys_[1].set_next_of(send_keys_[0]);
  receive_keys_[0].set(keys.suite, keys.receive);
  receive_keys_[1].set_next_of(receive_keys_[0]);
}

expected<void, SealError> SealedSession::seal(ConstBytes header, ConstBytes payload,
                                              MutableBytes out) noexcept {
  if (has_ended()) return unexpected{SealError::kEnded};
  if (out.size() != header.size() + payload.size() + kTrailerSize) {
    return unexpected{SealError::kBadSize};
  }
  // sec-5-1, sec-5-2: counters never repeat, so the session ends with the last one.
  const std::uint64_t counter = send_counter_;
  if (counter >= limits_.counter_end) {
    end();
    return unexpected{SealError::kEnded};
  }
  const AeadKey& key = send_keys_[generation_of(counter) % send_keys_.size()];
  std::byte* const trailer = out.data() + header.size() + payload.size();
  // The header may already be in place.
  if (out.data() != header.data()) std::ranges::copy(header, out.begin());
  key.seal(counter, out.first(header.size()), payload, out.subspan(header.size(), payload.size()),
           std::span<std::byte, kTagSize>(trailer + 8, kTagSize));
  store_le(trailer, counter);
  advance_send();
  return {};
}

void SealedSession::advance_send() noexcept {
  const std::uint64_t before = generation_of(send_counter_);
  const std::uint64_t after = generation_of(++send_counter_);
  if (after == before) return;
  // The current key has become the previous one; its slot gets the key after the next.
  send_keys_[(after + 1) % send_keys_.size()].set_next_of(send_keys_[after % send_keys_.size()]);
}

// sec-5-4, sec-5-5, sec-5-6, sec-5-7: a frame refused by these checks costs no cryptography.
expected<void, OpenError> SealedSession::judge(std::uint64_t counter) const noexcept {
  if (counter >= limits_.counter_end) return unexpected{OpenError::kBeyond};
  if (order_ == Order::kExact && counter != window_.next()) return unexpected{OpenError::kReplayed};
  if (!window_.is_new(counter)) return unexpected{OpenError::kReplayed};
  const std::uint64_t generation = generation_of(counter);
  if (generation + 1 < receive_generation_ || generation > receive_generation_ + 1) {
    return unexpected{OpenError::kBeyond};
  }
  return {};
}

expected<ConstBytes, OpenError> SealedSession::open(std::size_t header_size,
                                                    MutableBytes frame) noexcept {
  if (has_ended()) return unexpected{OpenError::kEnded};
  if (frame.size() < header_size + kTrailerSize) return unexpected{OpenError::kTooShort};
  const std::size_t payload_size = frame.size() - header_size - kTrailerSize;
  const std::byte* const trailer = frame.data() + header_size + payload_size;
  const auto counter = load_le<std::uint64_t>(trailer);
  if (auto judged = judge(counter); !judged) return unexpected{judged.error()};
  const MutableBytes payload = frame.subspan(header_size, payload_size);
  if (!receive_key(generation_of(counter))
           .open(counter, frame.first(header_size), payload,
                 std::span<const std::byte, kTagSize>(trailer + 8, kTagSize), payload)) {
    if (++forged_count_ >= limits_.forged_max) end();
    return unexpected{OpenError::kForged};
  }
  accept(counter);
  return ConstBytes(payload);
}

// A frame changes the session only here, after its tag was verified (sec-5-3).
void SealedSession::accept(std::uint64_t counter) noexcept {
  window_.add(counter);
  const std::uint64_t generation = generation_of(counter);
  if (generation <= receive_generation_) return;
  // At most one key ahead: the next key becomes the current one, and a new next key replaces the
  // previous one.
  receive_generation_ = generation;
  receive_key(generation + 1).set_next_of(receive_key(generation));
}

void SealedSession::end() noexcept {
  is_alive_ = 0;
  for (AeadKey& key : send_keys_)
    key.wipe_key();
  for (AeadKey& key : receive_keys_)
    key.wipe_key();
}

}  // namespace rtpm::crypto
