#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "rtpm/base/bytes.hpp"
#include "rtpm/base/expected.hpp"

/// The frames between host and board, as FRAMES.md specifies them.
namespace rtpm::device_serial {

inline constexpr std::uint8_t kFramesVersion = 1;
inline constexpr std::size_t kHeaderSize = 6;
inline constexpr std::size_t kPayloadSizeMax = 1024;
inline constexpr std::size_t kChecksumSize = 4;
inline constexpr std::size_t kFrameSizeMax = kHeaderSize + kPayloadSizeMax + kChecksumSize;
/// Stuffed, with its delimiter.
inline constexpr std::size_t kWireSizeMax = kFrameSizeMax + kFrameSizeMax / 254 + 2;

/// Wire numbers.
enum class FrameType : std::uint8_t {
  kHello = 1,        ///< Host to board: opens a session.
  kDescription = 2,  ///< Board to host: the board's channels.
  kCommand = 3,      ///< Host to board: values to apply, and for how long.
  kState = 4,        ///< Board to host: the answer to one command.
};

/// One frame.
/// @ownership views its payload
struct Frame {
  FrameType type = FrameType::kHello;
  std::uint16_t sequence = 0;
  ConstBytes payload{};
};

/// Why bytes between two delimiters are not a frame of this version.
enum class FrameFault : std::uint8_t {
  kStuffing,  ///< Not COBS, or too long.
  kShort,     ///< Shorter than a header and a checksum.
  kChecksum,
  kVersion,  ///< Intact, but of another version.
  kLength,   ///< The header states another length.
  kType,     ///< A type that this version does not have.
};

/// Writes a frame as it goes over the line, with its delimiter.
/// @param payload  at most kPayloadSizeMax bytes
/// @param wire     kWireSizeMax bytes are always enough
/// @return bytes written; 0 if payload or frame are too large
/// @realtime alloc-free
[[nodiscard]] std::size_t encode(const Frame& frame, MutableBytes wire) noexcept;

/// Reads the bytes between two delimiters; any bytes are a frame or a fault.
/// @param buffer  receives the frame, which views it
/// @realtime alloc-free
[[nodiscard]] expected<Frame, FrameFault> decode(
    ConstBytes stuffed, std::array<std::byte, kFrameSizeMax>& buffer) noexcept;

/// Cuts a stream of bytes into frames at its delimiters, so that it is synchronized again after the
/// next delimiter, whatever came before.
/// @ownership holds one frame
/// @threads  one at a time
/// @realtime alloc-free
class FrameCutter {
 public:
  /// Calls `on_frame` with the frame or fault that each delimiter in `bytes` completes. A frame's
  /// payload is valid until `on_frame` returns.
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
  std::size_t size_ = 0;  ///< Greater than stuffed_: an overlong frame, which is dropped.
  std::array<std::byte, kFrameSizeMax> frame_{};
};

}  // namespace rtpm::device_serial
