#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "rtpm/base/bytes.hpp"
#include "rtpm/base/expected.hpp"

/// The frames between host and board, specified in FRAMES.md.
namespace rtpm::device_serial {

inline constexpr std::uint8_t kFramesVersion = 1;
inline constexpr std::size_t kHeaderSize = 6;
inline constexpr std::size_t kPayloadSizeMax = 1024;
inline constexpr std::size_t kChecksumSize = 4;
inline constexpr std::size_t kFrameSizeMax = kHeaderSize + kPayloadSizeMax + kChecksumSize;
/// The maximum size of a stuffed frame with its delimiter.
inline constexpr std::size_t kWireSizeMax = kFrameSizeMax + kFrameSizeMax / 254 + 2;

/// The values are those on the wire.
enum class FrameType : std::uint8_t {
  kHello = 1,        ///< Host to board: opens a session.
  kDescription = 2,  ///< Board to host: describes the board's channels.
  kCommand = 3,      ///< Host to board: the values to apply, and for how long.
  kState = 4,        ///< Board to host: the answer to one command.
};

/// One frame.
/// @ownership refers to its payload
struct Frame {
  FrameType type = FrameType::kHello;
  std::uint16_t sequence = 0;
  ConstBytes payload{};
};

/// Why the bytes between two delimiters are not a frame in this version.
enum class FrameFault : std::uint8_t {
  kStuffing,  ///< Not valid COBS, or too long.
  kShort,     ///< Shorter than a header and a checksum.
  kChecksum,
  kVersion,  ///< The frame is intact but has another version.
  kLength,   ///< The header states another length.
  kType,     ///< The type does not exist in this version.
};

/// Encodes a frame for the line, with its delimiter.
/// @param payload  at most kPayloadSizeMax bytes
/// @param wire     kWireSizeMax bytes are always enough
/// @return the number of bytes written; 0 if the payload or frame is too large
/// @realtime alloc-free
[[nodiscard]] std::size_t encode(const Frame& frame, MutableBytes wire) noexcept;

/// Decodes the bytes between two delimiters; every byte sequence is a frame or a fault.
/// @param buffer  stores the frame's contents, to which the result refers
/// @realtime alloc-free
[[nodiscard]] expected<Frame, FrameFault> decode(
    ConstBytes stuffed, std::array<std::byte, kFrameSizeMax>& buffer) noexcept;

/// Cuts a byte stream into frames at the delimiters. After any errors it is synchronized again at
/// the next delimiter.
/// @ownership stores one frame
/// @threads  one at a time
/// @realtime alloc-free
class FrameCutter {
 public:
  /// Calls `on_frame` with the frame or fault that each delimiter in `bytes` completes. The payload
  /// of a frame is valid until `on_frame` returns.
  template <class OnFrame>
  void push(ConstBytes bytes, OnFrame&& on_frame) {
    for (const std::byte byte : bytes) {
      if (byte != std::byte{0}) {
        append(byte);
      } else if (size_ > 0) {  // Two adjacent delimiters enclose no frame.
        on_frame(finish());
      }
    }
  }

 private:
  void append(std::byte byte) noexcept {
    if (size_ < stuffed_.size()) stuffed_[size_] = byte;
    ++size_;
    if (size_ > stuffed_.size()) size_ = stuffed_.size() + 1;
  }
  [[nodiscard]] expected<Frame, FrameFault> finish() noexcept;

  std::array<std::byte, kWireSizeMax> stuffed_{};
  /// If greater than the size of stuffed_, the frame is overlong and is dropped.
  std::size_t size_ = 0;
  std::array<std::byte, kFrameSizeMax> frame_{};
};

}  // namespace rtpm::device_serial
