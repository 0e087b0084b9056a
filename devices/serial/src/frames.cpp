#include "rtpm/device_serial/frames.hpp"

#include <algorithm>
#include <utility>

#include "rtpm/base/hash.hpp"

namespace rtpm::device_serial {
namespace {

constexpr std::size_t kRunMax = 254;  ///< Size of a COBS group without its code byte.

/// Stuffs `from`, without a delimiter. `to` must be large enough.
std::size_t stuff(ConstBytes from, MutableBytes to) noexcept {
  std::size_t code_at = 0;
  std::size_t size = 1;
  const auto close_group = [&] {
    to[code_at] = static_cast<std::byte>(size - code_at);
    code_at = size++;
  };
  for (std::size_t i = 0; i < from.size(); ++i) {
    if (from[i] == std::byte{0}) {
      close_group();
      continue;
    }
    to[size++] = from[i];
    if (size - code_at == kRunMax + 1 && i + 1 < from.size()) close_group();
  }
  to[code_at] = static_cast<std::byte>(size - code_at);
  return size;
}

/// @return the size; 0 if the bytes are not COBS or do not fit in `to`
std::size_t unstuff(ConstBytes from, MutableBytes to) noexcept {
  std::size_t size = 0;
  std::size_t at = 0;
  while (at < from.size()) {
    const auto code = std::to_integer<std::size_t>(from[at++]);
    if (code == 0 || code - 1 > from.size() - at) return 0;
    const std::size_t run = code - 1;
    const bool ends_with_zero = run < kRunMax && at + run < from.size();
    if (size + run + (ends_with_zero ? 1 : 0) > to.size()) return 0;
    std::ranges::copy(from.subspan(at, run), to.subspan(size).begin());
    at += run;
    size += run;
    if (ends_with_zero) to[size++] = std::byte{0};
  }
  return size;
}

}  // namespace

std::size_t encode(const Frame& frame, MutableBytes wire) noexcept {
  if (frame.payload.size() > kPayloadSizeMax) return 0;
  std::array<std::byte, kFrameSizeMax> bytes{};
  ByteWriter writer(bytes);
  writer.put(kFramesVersion);
  writer.put(static_cast<std::uint8_t>(frame.type));
  writer.put(frame.sequence);
  writer.put(static_cast<std::uint16_t>(frame.payload.size()));
  writer.put_bytes(frame.payload);
  writer.put(crc32(ConstBytes(bytes).first(writer.size())));
  const std::size_t size = writer.size();
  if (wire.size() < size + size / kRunMax + 2) return 0;
  const std::size_t stuffed_size = stuff(ConstBytes(bytes).first(size), wire);
  wire[stuffed_size] = std::byte{0};
  return stuffed_size + 1;
}

expected<Frame, FrameFault> decode(ConstBytes stuffed,
                                   std::array<std::byte, kFrameSizeMax>& buffer) noexcept {
  const std::size_t size = unstuff(stuffed, buffer);
  if (size == 0) return unexpected{FrameFault::kStuffing};
  if (size < kHeaderSize + kChecksumSize) return unexpected{FrameFault::kShort};
  const ConstBytes bytes = ConstBytes(buffer).first(size);
  const ConstBytes body = bytes.first(size - kChecksumSize);
  if (load_le<std::uint32_t>(bytes.data() + body.size()) != crc32(body))
    return unexpected{FrameFault::kChecksum};
  ByteReader reader(body);
  if (reader.take<std::uint8_t>() != kFramesVersion) return unexpected{FrameFault::kVersion};
  const auto type = reader.take<std::uint8_t>();
  Frame frame{static_cast<FrameType>(type), reader.take<std::uint16_t>(), {}};
  if (reader.take<std::uint16_t>() != reader.left()) return unexpected{FrameFault::kLength};
  if (type < static_cast<std::uint8_t>(FrameType::kHello) ||
      type > static_cast<std::uint8_t>(FrameType::kState))
    return unexpected{FrameFault::kType};
  frame.payload = reader.take_bytes(reader.left());
  return frame;
}

expected<Frame, FrameFault> FrameCutter::finish() noexcept {
  const std::size_t size = std::exchange(size_, 0);
  if (size > stuffed_.size()) return unexpected{FrameFault::kStuffing};
  return decode(ConstBytes(stuffed_).first(size), frame_);
}

}  // namespace rtpm::device_serial
