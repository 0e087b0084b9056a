#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "rtpm/base/bytes.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/wire/header.hpp"
#include "rtpm/wire/limits.hpp"
#include "rtpm/wire/medium.hpp"

/// Streams: one call is answered by many items, in order, without loss, at the reader's pace. An
/// item larger than a frame is sent in fragments. Frames are numbered; credit counts items and
/// bytes. Only the client repeats and queries by time; the server only ends a stream's lease. All
/// functions are alloc-free.
/// @source   spec/hprotocol.md#hp-5.10
namespace rtpm::wire {

/// The payload of CREDIT: which frames have arrived, and how many bytes may be sent. The header
/// holds the limit of items.
struct StreamCredit {
  static constexpr std::size_t kSize = 16;

  std::uint32_t first_missing = 0;  ///< All frames before it have arrived.
  std::uint32_t byte_limit = 0;     ///< How many bytes all frames of the stream may carry.
  std::uint64_t later = 0;          ///< Bit i: frame first_missing + 1 + i has arrived.
};

void encode(const StreamCredit& credit, MutableBytes to) noexcept;
[[nodiscard]] std::optional<StreamCredit> decode_credit(ConstBytes payload) noexcept;

/// How many bytes of items a server may send before the first CREDIT (hp-5.10-9).
[[nodiscard]] constexpr std::uint32_t stream_bytes_first(Medium medium) noexcept {
  return medium == Medium::kDatagram ? kStreamBytesFirstDatagram : kStreamBytesFirstStream;
}

/// The server's end of one stream: splits items into numbered frames; over datagrams it keeps them
/// and repeats lost ones.
/// @ownership writes its frames into the memory given to begin()
class OutgoingStream {
 public:
  struct Buffers {
    MutableBytes memory{};            ///< One frame; over datagrams, as many as are kept.
    std::size_t frame_size = 0;       ///< Bytes of `memory` per frame, including the header.
    std::uint32_t fragment_size = 0;  ///< The largest payload of a frame; must fit `frame_size`.
  };
  /// Starts the stream that the call `header` requests.
  /// @param first  the first frame's number: 0 on the wire (hp-5.10-1); tests of wrap-around use
  ///           other numbers
  void begin(const Header& header, const Buffers& buffers, Medium medium,
             std::uint32_t first = 0) noexcept;
  void clear() noexcept { buffers_ = {}; }
  [[nodiscard]] bool is_begun() const noexcept { return !buffers_.memory.empty(); }

  /// Writes the next frame of `item`.
  /// @param item  unchanged between calls while is_midway()
  /// @return the frame to send; empty if the caller accepts no more now
  [[nodiscard]] ConstBytes push(ConstBytes item, MonotonicTime now) noexcept;
  /// Whether only a part of an item was pushed.
  [[nodiscard]] bool is_midway() const noexcept { return header_.fragment_index > 0; }
  /// Processes the client's state and its new limits.
  /// @param is_asked  the client heard nothing for a while
  void on_credit(const StreamCredit& credit, std::uint32_t item_limit, bool is_asked) noexcept;
  /// The next frame to repeat; may be empty.
  [[nodiscard]] ConstBytes next() noexcept;

  /// The number of frames sent.
  [[nodiscard]] std::uint32_t count() const noexcept { return count_; }
  [[nodiscard]] bool is_acknowledged() const noexcept { return first_missing_ == count_; }

 private:
  [[nodiscard]] bool is_kept() const noexcept { return medium_ == Medium::kDatagram; }
  [[nodiscard]] std::byte* frame_of(std::uint32_t number) const noexcept;

  Header header_{};  ///< The next frame's header.
  Buffers buffers_{};
  Medium medium_ = Medium::kDatagram;
  std::uint32_t window_ = 0;
  std::uint32_t count_ = 0;
  std::uint32_t item_count_ = 0;  ///< Items started.
  std::uint32_t item_limit_ = 0;  ///< The client's limit of items.
  std::uint32_t byte_count_ = 0;  ///< Payload bytes sent.
  std::uint32_t byte_limit_ = 0;  ///< The client's limit of bytes.
  std::uint32_t first_missing_ = 0;
  std::uint64_t repairs_ = 0;  ///< Bit i: frame first_missing_ + i must be repeated.
  std::array<std::uint32_t, kStreamWindow> sizes_{};
};

/// The client's end of one stream: orders the frames and reassembles items. A frame is kept until
/// its item is taken, or until it is copied to the buffer of a larger item.
/// @ownership copies into the memory given to begin()
class IncomingStream {
 public:
  enum class Taken : std::uint8_t {
    kNew,        ///< The next frame in order.
    kAhead,      ///< An earlier frame is missing.
    kDuplicate,  ///< The frame had arrived before.
    kForeign,    ///< Not requested, too large, or not part of the current item.
  };

  /// The memory for collecting items.
  struct Buffers {
    MutableBytes frames{};          ///< See stream_frame_count().
    std::uint32_t frame_size = 0;   ///< The largest payload of a frame, a multiple of 16.
    MutableBytes item{};            ///< Holds one item larger than a frame.
    std::uint32_t byte_window = 0;  ///< Bytes accepted at a time.
  };
  /// @param window  items accepted at a time: 1…kStreamWindow
  /// @param first   the first frame's number, as in OutgoingStream
  void begin(const Buffers& buffers, std::uint32_t window, std::uint32_t first = 0) noexcept;
  void clear() noexcept { buffers_ = {}; }
  [[nodiscard]] bool is_begun() const noexcept { return !buffers_.frames.empty(); }

  /// Processes the frame that `header` describes. A frame that was ahead and turns out not to be
  /// part of the current item is dropped when its turn comes, see dropped_count().
  [[nodiscard]] Taken take(const Header& header, ConstBytes payload) noexcept;
  /// Processes the server's final count of frames.
  /// @return false if it contradicts the frames received
  [[nodiscard]] bool end(std::uint32_t count) noexcept;

  /// Returns the next item in order, valid until the next call; nullopt if it is not complete yet.
  [[nodiscard]] std::optional<ConstBytes> next() noexcept;
  [[nodiscard]] bool has_next() const noexcept { return ready_count_ > 0; }

  [[nodiscard]] StreamCredit credit() const noexcept;
  /// Items below this number are accepted.
  [[nodiscard]] std::uint32_t limit() const noexcept { return item_count_ + window_; }
  [[nodiscard]] std::uint32_t dropped_count() const noexcept { return dropped_count_; }
  /// The number of frames released.
  [[nodiscard]] std::uint32_t freed_count() const noexcept { return freed_; }
  [[nodiscard]] std::uint32_t byte_window() const noexcept { return buffers_.byte_window; }
  /// Whether the frame `number` would be the first one after a missing one.
  [[nodiscard]] bool reveals_gap(std::uint32_t number) const noexcept;
  /// Whether the current item lacks fragments.
  [[nodiscard]] bool is_midway() const noexcept { return at_hand_.index > 0; }
  [[nodiscard]] bool is_ended() const noexcept { return is_ended_; }
  /// Whether the stream ended and all its frames have arrived.
  [[nodiscard]] bool is_complete() const noexcept { return is_ended_ && first_missing_ == end_; }

 private:
  /// The fields of a frame's header that matter for reassembly.
  struct Part {
    std::uint32_t size = 0;
    std::uint32_t message_size = 0;
    std::uint32_t fragment_size = 0;  ///< 0 if the frame is a whole item.
    std::uint16_t index = 0;
    std::uint16_t count = 1;
  };
  enum class View : std::uint8_t { kNone, kFrame, kItem };

  [[nodiscard]] std::uint32_t slot_of(std::uint32_t number) const noexcept;
  [[nodiscard]] std::byte* frame_at(std::uint32_t slot) const noexcept;
  [[nodiscard]] bool fits(const Part& part) const noexcept;
  [[nodiscard]] std::uint32_t known_end() const noexcept;
  void accept(const Part& part) noexcept;
  void free_first() noexcept;
  void put_together() noexcept;

  Buffers buffers_{};
  std::uint32_t slot_count_ = 0;
  std::uint32_t window_ = 0;
  std::uint32_t freed_ = 0;       ///< The first frame still kept.
  std::uint32_t freed_slot_ = 0;  ///< The slot of that frame.
  std::uint32_t first_missing_ = 0;
  std::uint64_t present_ = 0;  ///< Bit i: frame first_missing_ + 1 + i has arrived.
  std::uint32_t end_ = 0;
  bool is_ended_ = false;
  Part at_hand_{};                 ///< The next expected part of the current item.
  std::uint32_t ready_count_ = 0;  ///< Complete items that next() has not returned.
  std::uint32_t item_count_ = 0;   ///< Items that the reader has finished with.
  std::uint32_t dropped_count_ = 0;
  std::uint32_t kept_bytes_ = 0;   ///< Payload bytes of the kept frames.
  std::uint32_t freed_bytes_ = 0;  ///< Payload bytes of the released frames.
  std::uint32_t filled_ = 0;       ///< Bytes of the item being reassembled.
  bool is_whole_ = false;          ///< The item being reassembled is complete.
  View view_ = View::kNone;        ///< The buffer that the reader views now.
  std::array<Part, kStreamFrameCountMax> parts_{};
};

/// How many frames an IncomingStream keeps for `window` items and `byte_window` bytes at a time:
/// the items' last frames, and fragments no smaller than hp-5.10-11 requires. At most
/// kStreamFrameCountMax.
[[nodiscard]] constexpr std::uint32_t stream_frame_count(Medium medium, std::uint32_t window,
                                                         std::uint32_t byte_window) noexcept {
  const std::uint32_t least = medium == Medium::kDatagram
                                  ? kMessageSizeFloor
                                  : static_cast<std::uint32_t>(kSharedPayloadSizeMax);
  return window + (byte_window + least - 1) / least;
}

/// How many bytes of a stream a client accepts at a time, given a frame's payload: as many as
/// fragments of a message may be unacknowledged.
[[nodiscard]] constexpr std::uint32_t stream_byte_window(Medium medium,
                                                         std::size_t frame_payload_max) noexcept {
  if (medium == Medium::kDatagram) return kStreamBytesFirstDatagram;
  const auto window = static_cast<std::uint32_t>(window_of(medium) * frame_payload_max);
  return window < kStreamBytesFirstStream ? kStreamBytesFirstStream : window;
}
static_assert(stream_frame_count(Medium::kDatagram, kStreamWindow, kStreamBytesFirstDatagram) <=
              kStreamFrameCountMax);
static_assert(stream_frame_count(Medium::kStream, kStreamWindow,
                                 stream_byte_window(Medium::kStream, kStreamPayloadSizeMax)) <=
              kStreamFrameCountMax);

}  // namespace rtpm::wire
