#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "rtpm/base/bytes.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/wire/header.hpp"
#include "rtpm/wire/limits.hpp"

/// Streams: one call that is answered by many items, in order, none lost, at the pace of whoever
/// takes them. The client drives: only it keeps time.   Source: spec/hprotocol.md#hp-5.10.
namespace rtpm::wire {

/// The payload of CREDIT: which items are there. How many more may come stands in the header.
struct StreamCredit {
  static constexpr std::size_t kSize = 16;

  std::uint32_t first_missing = 0;  ///< All items before it are there.
  std::uint64_t later = 0;          ///< Bit i: the item first_missing + 1 + i is there.
};

void encode(const StreamCredit& credit, MutableBytes to) noexcept;
[[nodiscard]] std::optional<StreamCredit> decode_credit(ConstBytes payload) noexcept;

/// The server's end of one stream: gives items their numbers, keeps them where they may get lost,
/// and sends those again that did.
/// Ownership: writes its frames into the memory it was given.   RT: alloc-free.
class OutgoingStream {
 public:
  /// Begins the stream that the call `header` asks for. `memory` holds one frame per item that may
  /// be on its way, or one frame in all where nothing gets lost (`is_kept` is false). The first
  /// item has the number `first`: 0 on the wire (hp-5.10-1), another to test the end of the
  /// numbers.
  void begin(const Header& header, MutableBytes memory, std::size_t frame_size, bool is_kept,
             std::uint32_t first = 0) noexcept;
  void clear() noexcept { memory_ = {}; }
  [[nodiscard]] bool is_begun() const noexcept { return !memory_.empty(); }

  /// Where the next item is to be written, aligned to 16 bytes; empty while the caller takes none.
  [[nodiscard]] MutableBytes item_buffer() noexcept;
  /// Ends the item that was written there; gives the frame to send.
  [[nodiscard]] ConstBytes push(std::uint32_t size, MonotonicTime now) noexcept;
  /// What the caller has, and up to where it takes more. `is_asked`: it heard nothing for a time.
  void on_credit(const StreamCredit& credit, std::uint32_t limit, bool is_asked) noexcept;
  /// A copy of the call grants at least so much.
  void raise_limit(std::uint32_t limit) noexcept;
  /// The next frame that is to be sent again, or empty.
  [[nodiscard]] ConstBytes next() noexcept;

  /// Items sent so far.
  [[nodiscard]] std::uint32_t count() const noexcept { return count_; }
  [[nodiscard]] bool is_acknowledged() const noexcept { return first_missing_ == count_; }

 private:
  [[nodiscard]] std::byte* frame_of(std::uint32_t number) const noexcept;

  Header header_{};
  MutableBytes memory_{};
  std::size_t frame_size_ = 0;
  std::uint32_t window_ = 0;
  bool is_kept_ = false;
  std::uint32_t count_ = 0;
  std::uint32_t limit_ = 0;
  std::uint32_t first_missing_ = 0;
  std::uint64_t repairs_ = 0;  ///< Bit i: the item first_missing_ + i is to be sent again.
  std::array<std::uint32_t, kStreamWindow> sizes_{};
};

/// The client's end of one stream: puts the items in order.
/// Ownership: copies items into the memory it was given.   RT: alloc-free.
class IncomingStream {
 public:
  enum class Taken : std::uint8_t {
    kNew,      ///< The next one in order is there, or it came in order.
    kAhead,    ///< One before it is missing.
    kCopy,     ///< It was there.
    kForeign,  ///< It was not asked for, or is too large.
  };

  /// Begins to take at most `window` (1…kStreamWindow) items at a time; `memory` holds so many of
  /// `item_size` bytes. The first has the number `first`, as in OutgoingStream.
  void begin(MutableBytes memory, std::uint32_t window, std::size_t item_size,
             std::uint32_t first = 0) noexcept;
  void clear() noexcept { memory_ = {}; }
  [[nodiscard]] bool is_begun() const noexcept { return !memory_.empty(); }

  [[nodiscard]] Taken take(std::uint32_t number, ConstBytes item) noexcept;
  /// The server says that it sent so many in all, and that there will be no more. False if that
  /// contradicts what came.
  [[nodiscard]] bool end(std::uint32_t count) noexcept;

  /// The next item in order, valid until the next call; nothing if it is not there yet.
  [[nodiscard]] std::optional<ConstBytes> next() noexcept;
  /// Has next() an item?
  [[nodiscard]] bool has_next() const noexcept;

  [[nodiscard]] StreamCredit credit() const noexcept;
  /// Items below this number are welcome.
  [[nodiscard]] std::uint32_t limit() const noexcept { return taken_ + window_; }
  /// Something lies behind an item that is missing.
  [[nodiscard]] bool has_gap() const noexcept { return present_ != 0; }
  [[nodiscard]] bool is_ended() const noexcept { return is_ended_; }
  /// All items that there will be are here.
  [[nodiscard]] bool is_complete() const noexcept { return is_ended_ && first_missing_ == end_; }

 private:
  [[nodiscard]] std::uint32_t place_of(std::uint32_t number) const noexcept;
  [[nodiscard]] std::byte* room_of(std::uint32_t number) const noexcept;

  MutableBytes memory_{};
  std::size_t item_size_ = 0;
  std::uint32_t window_ = 0;
  std::uint32_t taken_ = 0;        ///< The first item that its taker is not done with,
  std::uint32_t taken_place_ = 0;  ///< and which of the window's places has it.
  bool is_viewed_ = false;         ///< Its taker looks at that one now.
  std::uint32_t first_missing_ = 0;
  std::uint64_t present_ = 0;  ///< Bit i: the item first_missing_ + 1 + i is there.
  std::uint32_t end_ = 0;
  bool is_ended_ = false;
  std::array<std::uint32_t, kStreamWindow> sizes_{};
};

}  // namespace rtpm::wire
