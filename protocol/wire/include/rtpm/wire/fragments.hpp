#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "rtpm/base/bytes.hpp"
#include "rtpm/wire/header.hpp"
#include "rtpm/wire/limits.hpp"

/// Messages larger than one frame: sent in fragments, collected, and repaired where some were lost.
/// Source: spec/hprotocol.md#hp-5.6.
namespace rtpm::wire {

/// Which fragments of a message are there.   RT: alloc-free.
class FragmentSet {
 public:
  void reset(std::uint16_t count) noexcept;
  /// False if it was there already.
  bool insert(std::uint16_t index) noexcept;
  [[nodiscard]] bool contains(std::uint16_t index) const noexcept;
  /// The count if none is missing.
  [[nodiscard]] std::uint16_t first_missing() const noexcept { return first_missing_; }
  [[nodiscard]] std::uint16_t count() const noexcept { return count_; }
  [[nodiscard]] bool is_complete() const noexcept { return first_missing_ == count_; }

 private:
  std::array<std::uint64_t, kFragmentCountMax / 64> words_{};
  std::uint16_t count_ = 0;
  std::uint16_t first_missing_ = 0;
};

/// The payload of ACK: how far the receiver of a fragmented message is.
struct FragmentAck {
  static constexpr std::size_t kSize = 40;
  static constexpr std::uint16_t kLaterCount = 256;

  std::uint16_t first_missing = 0;
  /// Bit i: the fragment first_missing + 1 + i is there.
  std::array<std::uint64_t, kLaterCount / 64> later{};

  [[nodiscard]] bool has_later(std::uint16_t i) const noexcept {
    return ((later[i / 64U] >> (i % 64U)) & 1U) != 0;
  }
};

void encode(const FragmentAck& ack, MutableBytes to) noexcept;
[[nodiscard]] std::optional<FragmentAck> decode_ack(ConstBytes payload) noexcept;

/// Collects one message from its fragments, in whatever order and how often they come.
/// Ownership: writes into the buffer it was given.   RT: alloc-free.
class IncomingMessage {
 public:
  enum class Taken : std::uint8_t { kNew, kDuplicate, kLast, kForeign };

  /// Begins with the message that `header`, of any of its fragments, describes. The buffer holds
  /// it.
  void begin(const Header& header, MutableBytes buffer) noexcept;
  /// Takes one fragment. kLast: now all are there. kForeign: it is of another message.
  [[nodiscard]] Taken take(const Header& header, ConstBytes payload) noexcept;
  [[nodiscard]] FragmentAck ack() const noexcept;
  [[nodiscard]] ConstBytes message() const noexcept { return buffer_; }
  [[nodiscard]] bool is_begun() const noexcept { return !buffer_.empty(); }
  [[nodiscard]] bool is_complete() const noexcept { return is_begun() && arrived_.is_complete(); }
  void clear() noexcept { buffer_ = {}; }

 private:
  Header header_{};  ///< Of the fragment that came first.
  MutableBytes buffer_{};
  std::uint32_t fragment_size_ = 0;
  FragmentSet arrived_;
};

/// Sends one message as fragments: a window of them at a time, those again that an ACK shows to be
/// lost. It keeps no time: its driver calls nudge() when an ACK stays out.
/// Ownership: views the message.   RT: alloc-free.
class OutgoingMessage {
 public:
  /// Begins with `message` (not empty) under the header of its frames, `window` (even) at a time.
  void begin(const Header& header, ConstBytes message, std::uint32_t fragment_size,
             std::uint16_t window) noexcept;
  /// Writes the next frame that may be sent now, with the stated budget and time, at the beginning
  /// of `to` (a header and a fragment fit); empty if the window is full or all is sent.
  [[nodiscard]] ConstBytes next(MutableBytes to, std::uint32_t budget_us,
                                MonotonicTime now) noexcept;
  /// Writes the first fragment once more, wanting an ACK: to ask what became of a message that
  /// arrived.
  [[nodiscard]] ConstBytes first_again(MutableBytes to, std::uint32_t budget_us,
                                       MonotonicTime now) noexcept;
  /// How far its receiver is. `is_asked`: he heard nothing for a time, so that he is to be sent
  /// something: the first that is missing, if the rest does not follow from the ACK.
  void on_ack(const FragmentAck& ack, bool is_asked = false) noexcept;
  /// No ACK came in time: the first fragment without one is due again.
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
  std::uint16_t next_new_ = 0;     ///< The first fragment that was never sent.
  std::uint16_t repair_next_ = 0;  ///< Of those sent before, these may be lost: from here
  std::uint16_t repair_end_ = 0;   ///< to here, less the acknowledged ones.
};

}  // namespace rtpm::wire
