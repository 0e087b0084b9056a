#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "rtpm/base/bytes.hpp"
#include "rtpm/wire/header.hpp"
#include "rtpm/wire/limits.hpp"

/// Messages larger than a frame: sent in fragments and reassembled; lost fragments are sent again.
/// All functions are alloc-free.
/// @source   spec/hprotocol.md#hp-5.6
namespace rtpm::wire {

/// Which fragments of a message have arrived.
class FragmentSet {
 public:
  void reset(std::uint16_t count) noexcept;
  /// @return false if the fragment is already in the set
  bool insert(std::uint16_t index) noexcept;
  [[nodiscard]] bool contains(std::uint16_t index) const noexcept;
  /// The first missing fragment; count() if none is missing.
  [[nodiscard]] std::uint16_t first_missing() const noexcept { return first_missing_; }
  [[nodiscard]] std::uint16_t count() const noexcept { return count_; }
  [[nodiscard]] bool is_complete() const noexcept { return first_missing_ == count_; }

 private:
  std::array<std::uint64_t, kFragmentCountMax / 64> words_{};
  std::uint16_t count_ = 0;
  std::uint16_t first_missing_ = 0;
};

/// The payload of ACK: which fragments of a message have arrived.
struct FragmentAck {
  static constexpr std::size_t kSize = 40;
  static constexpr std::uint16_t kLaterCount = 256;

  std::uint16_t first_missing = 0;
  /// Bit i: fragment first_missing + 1 + i has arrived.
  std::array<std::uint64_t, kLaterCount / 64> later{};

  [[nodiscard]] bool has_later(std::uint16_t i) const noexcept {
    return ((later[i / 64U] >> (i % 64U)) & 1U) != 0;
  }
};

void encode(const FragmentAck& ack, MutableBytes to) noexcept;
[[nodiscard]] std::optional<FragmentAck> decode_ack(ConstBytes payload) noexcept;

/// Reassembles one message from its fragments, which may arrive in any order and repeatedly.
/// @ownership writes into the buffer given to begin()
class IncomingMessage {
 public:
  enum class Taken : std::uint8_t { kNew, kDuplicate, kLast, kForeign };

  /// Starts the message that `header`, from any of its fragments, describes.
  /// @param buffer  must hold the whole message
  void begin(const Header& header, MutableBytes buffer) noexcept;
  /// @return kLast: the message is complete; kForeign: the fragment belongs to another message
  [[nodiscard]] Taken take(const Header& header, ConstBytes payload) noexcept;
  [[nodiscard]] FragmentAck ack() const noexcept;
  [[nodiscard]] ConstBytes message() const noexcept { return buffer_; }
  [[nodiscard]] bool is_begun() const noexcept { return !buffer_.empty(); }
  [[nodiscard]] bool is_complete() const noexcept { return is_begun() && arrived_.is_complete(); }
  void clear() noexcept { buffer_ = {}; }

 private:
  Header header_{};  ///< The header of the first received fragment.
  MutableBytes buffer_{};
  std::uint32_t fragment_size_ = 0;
  FragmentSet arrived_;
};

/// Sends one message as fragments, a window at a time, and repeats those that an ACK reports as
/// lost. Has no timer: the caller calls nudge() if no ACK arrives.
/// @ownership views the message
class OutgoingMessage {
 public:
  /// @param message  not empty
  /// @param window   even
  void begin(const Header& header, ConstBytes message, std::uint32_t fragment_size,
             std::uint16_t window) noexcept;
  /// Writes the next frame that may be sent now to the beginning of `to`, which must hold a header
  /// and a fragment.
  /// @return the frame; empty if the window is full or everything is sent
  [[nodiscard]] ConstBytes next(MutableBytes to, std::uint32_t budget_us,
                                MonotonicTime now) noexcept;
  /// Writes the first fragment of a fully acknowledged message again and requests an ACK, to learn
  /// the state of its call.
  [[nodiscard]] ConstBytes first_again(MutableBytes to, std::uint32_t budget_us,
                                       MonotonicTime now) noexcept;
  /// Processes the receiver's state.
  /// @param is_asked  the receiver heard nothing for a while: sends at least the first fragment
  ///           that it lacks
  void on_ack(const FragmentAck& ack, bool is_asked = false) noexcept;
  /// Call it if no ACK arrived in time: the first unacknowledged fragment becomes due again.
  void nudge() noexcept;
  [[nodiscard]] bool is_begun() const noexcept { return !message_.empty(); }
  [[nodiscard]] bool is_acknowledged() const noexcept { return acknowledged_.is_complete(); }
  void clear() noexcept { message_ = {}; }

 private:
  [[nodiscard]] std::optional<std::uint16_t> choose() noexcept;
  [[nodiscard]] ConstBytes write(MutableBytes to, std::uint16_t index, std::uint16_t flags,
                                 std::uint32_t budget_us, MonotonicTime now) const noexcept;
  [[nodiscard]] bool has_more() const noexcept;

  Header header_{};
  ConstBytes message_{};
  std::uint32_t fragment_size_ = 0;
  std::uint16_t window_ = kFragmentWindow;
  FragmentSet acknowledged_;
  std::uint16_t next_new_ = 0;     ///< The first fragment not sent yet.
  std::uint16_t repair_next_ = 0;  ///< The first fragment that may be lost.
  std::uint16_t repair_end_ = 0;   ///< The end of the fragments that may be lost.
};

}  // namespace rtpm::wire
