#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "rtpm/base/bytes.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/wire/cookie.hpp"
#include "rtpm/wire/fragments.hpp"
#include "rtpm/wire/header.hpp"
#include "rtpm/wire/limits.hpp"
#include "rtpm/wire/medium.hpp"

namespace rtpm::wire {

/// The buffer size for one large message, in whole cache lines.
[[nodiscard]] constexpr std::size_t large_buffer_size(std::uint32_t message_size_max) noexcept {
  constexpr std::size_t kCacheLine = 64;
  return (std::size_t{message_size_max} + kCacheLine - 1) / kCacheLine * kCacheLine;
}

/// The call that a server's large message or stream belongs to.
struct CallPlace {
  std::uint32_t session_index = 0;
  std::uint32_t slot_index = 0;
};

/// The messages larger than a frame that a lane's sessions receive, serve and send, each in a
/// buffer. One buffer is the scratch, where replies are written.
/// @threads  one
/// @realtime alloc-free except construction; find() and the counts are linear in the buffers
/// @source   spec/hprotocol.md#hp-5.6
class LargeMessages {
 public:
  static constexpr std::uint16_t kNone = 0xffff;  ///< The index that means no buffer.
  struct Config {
    MutableBytes memory{};  ///< Owned by the caller; aligned to 64 bytes.
    std::uint32_t message_size_max = 0;
    std::uint32_t fragment_size = 0;  ///< The largest payload of a frame.
    Medium medium = Medium::kDatagram;
  };

  explicit LargeMessages(const Config& config);

  /// Whether there are buffers; without them no message may be larger than a frame.
  [[nodiscard]] bool has_buffers() const noexcept { return scratch_ != kNone; }
  /// The buffer where replies are written, if it has_buffers().
  [[nodiscard]] MutableBytes scratch() const noexcept { return buffers_[scratch_].memory; }

  /// Whether a host may find no buffer now. False while fewer than a host's quota are in use.
  [[nodiscard]] bool may_lack() const noexcept {
    return held_count_ >= share_of_one_host(capacity());
  }
  /// Finds a buffer for a message of that host: a free one, or the one silent for longest; once the
  /// host has used up its quota, only one of that host's buffers (hp-5.6-11). kNone if there is
  /// none.
  [[nodiscard]] std::uint16_t find(const PeerAddress& peer, MonotonicTime now) const noexcept;
  /// When, after `now`, the next message may be evicted.
  [[nodiscard]] MonotonicTime next_idle_time(MonotonicTime now) const noexcept;
  /// Messages whose peer was recently heard (hp-5.6-10).
  [[nodiscard]] std::uint32_t awaited_count(MonotonicTime now) const noexcept;
  /// Whether a buffer became free since the last call.
  [[nodiscard]] bool take_freed() noexcept { return std::exchange(has_freed_, false); }

  [[nodiscard]] bool is_free(std::uint16_t index) const noexcept {
    return buffers_[index].use == Use::kFree;
  }
  [[nodiscard]] bool is_reply(std::uint16_t index) const noexcept {
    return buffers_[index].use == Use::kReply;
  }
  [[nodiscard]] const CallPlace& call_of(std::uint16_t index) const noexcept {
    return buffers_[index].call;
  }
  /// Until when its caller waits.
  [[nodiscard]] MonotonicTime deadline_of(std::uint16_t index) const noexcept {
    return buffers_[index].deadline;
  }
  void free(std::uint16_t index) noexcept;

  /// Takes a free buffer for a message of `peer` that will be received, reserved or sent.
  void take(std::uint16_t index, const CallPlace& call, const PeerAddress& peer,
            MonotonicTime deadline, MonotonicTime now) noexcept;
  /// Starts to receive the request that `header`, from any of its fragments, describes.
  void receive(std::uint16_t index, const Header& header) noexcept;
  /// Processes a fragment of a request. A complete one is served until it is freed.
  [[nodiscard]] IncomingMessage::Taken take_fragment(std::uint16_t index, const Header& header,
                                                     ConstBytes payload,
                                                     MonotonicTime now) noexcept;
  [[nodiscard]] const IncomingMessage& request(std::uint16_t index) const noexcept {
    return buffers_[index].incoming;
  }

  /// Returns the taken buffer to its caller, who writes a reply there meanwhile.
  [[nodiscard]] MutableBytes reserve(std::uint16_t index) const noexcept {
    return buffers_[index].memory;
  }
  /// Makes a reserved buffer the scratch, and frees the previous scratch.
  void put_in_place_of_scratch(MutableBytes reserved) noexcept;
  /// Turns the scratch into the reply that `header` describes; the buffer `next`, which was taken
  /// for it, becomes the new scratch.
  /// @return its index; next_frame() returns its fragments
  [[nodiscard]] std::uint16_t send_scratch(std::uint16_t next, const Header& header) noexcept;
  /// Processes the client's state of a reply; next_frame() then returns its frames.
  /// @return whether everything has arrived
  [[nodiscard]] bool on_ack(std::uint16_t index, const FragmentAck& ack, bool is_asked,
                            MonotonicTime now) noexcept;
  /// Lets next_frame() return the unacknowledged fragments of a reply.
  void send_again(std::uint16_t index, MonotonicTime now) noexcept;
  /// The next fragment of the reply being sent, valid until the next one; may be empty.
  [[nodiscard]] ConstBytes next_frame(MonotonicTime now) noexcept {
    return sending_ == kNone ? ConstBytes{} : next_fragment(now);
  }
  /// Makes next_frame() return nothing until another reply is sent.
  void stop_sending() noexcept { sending_ = kNone; }

 private:
  enum class Use : std::uint8_t {
    kFree,
    kScratch,
    kReserved,
    kIncoming,  ///< A request with missing fragments.
    kServed,    ///< A request that is running.
    kReply,
  };
  struct Buffer {
    Use use = Use::kFree;
    CallPlace call{};
    PeerAddress peer{};
    MonotonicTime deadline{};
    MonotonicTime heard{};  ///< When its peer last sent a frame about it.
    MutableBytes memory{};
    IncomingMessage incoming;
    OutgoingMessage outgoing;
  };

  /// How many messages it may hold; the scratch does not count.
  [[nodiscard]] std::uint32_t capacity() const noexcept {
    return buffers_.empty() ? 0 : static_cast<std::uint32_t>(buffers_.size()) - 1;
  }
  [[nodiscard]] ConstBytes next_fragment(MonotonicTime now) noexcept;
  /// When a message may be evicted (hp-5.6-10).
  [[nodiscard]] static MonotonicTime idle_time(const Buffer& buffer) noexcept;

  Config config_;
  std::vector<Buffer> buffers_;
  std::uint32_t held_count_ = 0;  ///< Buffers that are neither free nor the scratch.
  bool has_freed_ = false;
  std::uint16_t scratch_ = kNone;
  std::uint16_t sending_ = kNone;  ///< The reply whose window next_frame() continues.
  std::vector<std::byte> frame_;   ///< One frame of a reply, ready to send.
};

}  // namespace rtpm::wire
