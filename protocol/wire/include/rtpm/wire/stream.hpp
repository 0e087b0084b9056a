#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "rtpm/base/bytes.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/wire/header.hpp"
#include "rtpm/wire/limits.hpp"
#include "rtpm/wire/medium.hpp"

/// Streams: one call that is answered by many items, in order, none lost, at the pace of their
/// reader. An item larger than a frame goes in fragments. The frames of a stream are numbered; its
/// credit counts items and bytes. The client drives: only it keeps time.
/// Source: spec/hprotocol.md#hp-5.10.
namespace rtpm::wire {

/// The payload of CREDIT: which frames are there, and up to which byte more may come. Up to which
/// item stands in the header.
struct StreamCredit {
  static constexpr std::size_t kSize = 16;

  std::uint32_t first_missing = 0;  ///< All frames before it are there.
  std::uint32_t byte_limit = 0;     ///< The payloads of all frames together may have so many bytes.
  std::uint64_t later = 0;          ///< Bit i: the frame first_missing + 1 + i is there.
};

void encode(const StreamCredit& credit, MutableBytes to) noexcept;
[[nodiscard]] std::optional<StreamCredit> decode_credit(ConstBytes payload) noexcept;

/// How many bytes of items a server may send before the first CREDIT (hp-5.10-9).
[[nodiscard]] constexpr std::uint32_t stream_bytes_first(Medium medium) noexcept {
  return medium == Medium::kDatagram ? kStreamBytesFirstDatagram : kStreamBytesFirstStream;
}

/// The server's end of one stream: cuts items into frames and numbers these, keeps them where they
/// may get lost, and sends those again that did.
/// Ownership: writes its frames into the memory it was given.   RT: alloc-free.
class OutgoingStream {
 public:
  /// What begin() needs to know besides the call.
  struct Buffers {
    MutableBytes memory{};            ///< Of one frame, or as many as are kept on datagrams.
    std::size_t frame_size = 0;       ///< Bytes of `memory` for each frame, header included.
    std::uint32_t fragment_size = 0;  ///< The largest payload of a frame; fits `frame_size`.
  };
  /// Begins the stream that the call `header` asks for. The first frame has the number `first`: 0
  /// on the wire (hp-5.10-1), another to test the end of the numbers.
  void begin(const Header& header, const Buffers& buffers, Medium medium,
             std::uint32_t first = 0) noexcept;
  void clear() noexcept { buffers_ = {}; }
  [[nodiscard]] bool is_begun() const noexcept { return !buffers_.memory.empty(); }

  /// Writes the next frame of `item`, which has to be the same from call to call while
  /// is_midway(), and gives it to send; empty while the caller takes no more.
  [[nodiscard]] ConstBytes push(ConstBytes item, MonotonicTime now) noexcept;
  /// A part of an item was pushed, and the rest was not.
  [[nodiscard]] bool is_midway() const noexcept { return header_.fragment_index > 0; }
  /// What the caller has, and up to where it takes more. `is_asked`: it heard nothing for a time.
  void on_credit(const StreamCredit& credit, std::uint32_t item_limit, bool is_asked) noexcept;
  /// The next frame that is to be sent again, or empty.
  [[nodiscard]] ConstBytes next() noexcept;

  [[nodiscard]] std::uint32_t count() const noexcept { return count_; }
  [[nodiscard]] bool is_acknowledged() const noexcept { return first_missing_ == count_; }

 private:
  [[nodiscard]] bool is_kept() const noexcept { return medium_ == Medium::kDatagram; }
  [[nodiscard]] std::byte* frame_of(std::uint32_t number) const noexcept;

  Header header_{};  ///< Of the next frame; its fragment numbers are of the item at hand.
  Buffers buffers_{};
  Medium medium_ = Medium::kDatagram;
  std::uint32_t window_ = 0;
  std::uint32_t count_ = 0;
  std::uint32_t item_count_ = 0;  ///< Items begun,
  std::uint32_t item_limit_ = 0;  ///< and how many may be.
  std::uint32_t byte_count_ = 0;  ///< Payload bytes sent,
  std::uint32_t byte_limit_ = 0;  ///< and how many may be.
  std::uint32_t first_missing_ = 0;
  std::uint64_t repairs_ = 0;  ///< Bit i: the frame first_missing_ + i is to be sent again.
  std::array<std::uint32_t, kStreamWindow> sizes_{};
};

/// The client's end of one stream: puts the frames in order and makes items of them. A frame stays
/// where it came until its item is taken, or its part is copied to where a larger item is put
/// together.
/// Ownership: copies into the memory it was given.   RT: alloc-free.
class IncomingStream {
 public:
  enum class Taken : std::uint8_t {
    kNew,        ///< It is the next one in order.
    kAhead,      ///< One before it is missing.
    kDuplicate,  ///< It was there.
    kForeign,    ///< It was not asked for, is too large, or is no part of the item at hand.
  };

  /// Where items are collected.
  struct Buffers {
    MutableBytes frames{};          ///< See stream_frame_count().
    std::uint32_t frame_size = 0;   ///< The largest payload of a frame, a multiple of 16.
    MutableBytes item{};            ///< For one item larger than that: as large as items may be.
    std::uint32_t byte_window = 0;  ///< Bytes that are taken at a time.
  };
  /// Begins to take at most `window` (1…kStreamWindow) items at a time. The first frame has the
  /// number `first`, as in OutgoingStream.
  void begin(const Buffers& buffers, std::uint32_t window, std::uint32_t first = 0) noexcept;
  void clear() noexcept { buffers_ = {}; }
  [[nodiscard]] bool is_begun() const noexcept { return !buffers_.frames.empty(); }

  /// Takes the frame that `header` describes. One that was ahead and turns out to be no part of the
  /// item at hand is dropped when its turn comes: dropped_count() tells.
  [[nodiscard]] Taken take(const Header& header, ConstBytes payload) noexcept;
  /// The server says that it sent so many frames in all, and that there will be no more. False if
  /// that contradicts what came.
  [[nodiscard]] bool end(std::uint32_t count) noexcept;

  /// The next item in order, valid until the next call; nothing if it is not there yet.
  [[nodiscard]] std::optional<ConstBytes> next() noexcept;
  [[nodiscard]] bool has_next() const noexcept { return ready_count_ > 0; }

  [[nodiscard]] StreamCredit credit() const noexcept;
  /// Items below this number are welcome.
  [[nodiscard]] std::uint32_t limit() const noexcept { return item_count_ + window_; }
  [[nodiscard]] std::uint32_t dropped_count() const noexcept { return dropped_count_; }
  /// Frames of which nothing is kept any more.
  [[nodiscard]] std::uint32_t freed_count() const noexcept { return freed_; }
  [[nodiscard]] std::uint32_t byte_window() const noexcept { return buffers_.byte_window; }
  /// Would the frame `number` be the first to come behind one that is missing?
  [[nodiscard]] bool reveals_gap(std::uint32_t number) const noexcept;
  /// The item at hand lacks fragments.
  [[nodiscard]] bool is_midway() const noexcept { return at_hand_.index > 0; }
  [[nodiscard]] bool is_ended() const noexcept { return is_ended_; }
  /// All frames that there will be are here.
  [[nodiscard]] bool is_complete() const noexcept { return is_ended_ && first_missing_ == end_; }

 private:
  /// What a frame says of itself.
  struct Part {
    std::uint32_t size = 0;
    std::uint32_t message_size = 0;
    std::uint32_t fragment_size = 0;  ///< 0: it is a whole item.
    std::uint16_t index = 0;
    std::uint16_t count = 1;
  };
  enum class View : std::uint8_t { kNone, kFrame, kItem };

  [[nodiscard]] std::uint32_t place_of(std::uint32_t number) const noexcept;
  [[nodiscard]] std::byte* frame_at(std::uint32_t place) const noexcept;
  [[nodiscard]] bool fits(const Part& part) const noexcept;
  [[nodiscard]] std::uint32_t known_end() const noexcept;
  void accept(const Part& part) noexcept;
  void free_first() noexcept;
  void put_together() noexcept;

  Buffers buffers_{};
  std::uint32_t place_count_ = 0;
  std::uint32_t window_ = 0;
  std::uint32_t freed_ = 0;        ///< The first frame that is still kept,
  std::uint32_t freed_place_ = 0;  ///< and its place.
  std::uint32_t first_missing_ = 0;
  std::uint64_t present_ = 0;  ///< Bit i: the frame first_missing_ + 1 + i is there.
  std::uint32_t end_ = 0;
  bool is_ended_ = false;
  Part at_hand_{};                 ///< Of the item whose frames come in order: the next expected.
  std::uint32_t ready_count_ = 0;  ///< Whole items in order that next() has not given.
  std::uint32_t item_count_ = 0;   ///< Items that their reader is done with.
  std::uint32_t dropped_count_ = 0;
  std::uint32_t kept_bytes_ = 0;   ///< In the frames that are kept,
  std::uint32_t freed_bytes_ = 0;  ///< and in those that were.
  std::uint32_t filled_ = 0;       ///< Bytes of the item that is put together.
  bool is_whole_ = false;          ///< All of it is there.
  View view_ = View::kNone;        ///< What the reader looks at now.
  std::array<Part, kStreamFrameCountMax> parts_{};
};

/// How many frames an IncomingStream has to keep for `window` items and `byte_window` bytes at a
/// time, at most kStreamFrameCountMax: the last ones of the items, and the fragments before them,
/// none of which is smaller than hp-5.10-11 says.
[[nodiscard]] constexpr std::uint32_t stream_frame_count(Medium medium, std::uint32_t window,
                                                         std::uint32_t byte_window) noexcept {
  const std::uint32_t least = medium == Medium::kDatagram
                                  ? kMessageSizeFloor
                                  : static_cast<std::uint32_t>(kSharedPayloadSizeMax);
  return window + (byte_window + least - 1) / least;
}

/// How many bytes of a stream a client takes at a time where frames have so much payload: as many
/// as fragments of a message may be on their way.
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
