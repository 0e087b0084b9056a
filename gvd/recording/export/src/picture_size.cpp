#include <algorithm>

#include "matroska.hpp"
#include "nal_units.hpp"

namespace rtpm::exports {
namespace {

constexpr std::uint32_t kSizeMax = 1 << 14;

/// Reads bits, the highest first, of a NAL unit without emulation prevention. Beyond its end come
/// zeros.
class Bits {
 public:
  explicit Bits(ConstBytes unit) {
    int zero_count = 0;
    for (const std::byte byte : unit) {
      // ITU-T H.264, 7.4.1: 0x03 behind two zero bytes is not data.
      if (zero_count >= 2 && byte == std::byte{3}) {
        zero_count = 0;
        continue;
      }
      zero_count = byte == std::byte{0} ? zero_count + 1 : 0;
      bytes_.push_back(byte);
    }
  }
  std::uint32_t take(int count) noexcept {
    std::uint32_t value = 0;
    for (int i = 0; i < count; ++i, ++at_) {
      const std::size_t byte = at_ / 8;
      const auto bit = byte < bytes_.size()
                           ? (std::to_integer<unsigned>(bytes_[byte]) >> (7 - at_ % 8)) & 1U
                           : 0U;
      value = value << 1 | bit;
    }
    return value;
  }
  /// An Exp-Golomb code, ue(v); a malformed one is 0.
  std::uint32_t take_number() noexcept {
    int zero_count = 0;
    while (zero_count < 32 && take(1) == 0)
      ++zero_count;
    return zero_count >= 32 ? 0 : (1U << zero_count) - 1 + take(zero_count);
  }

 private:
  std::vector<std::byte> bytes_{};
  std::size_t at_ = 0;
};

/// Whether a profile states its chroma format.
bool states_chroma(std::uint32_t profile) noexcept {
  constexpr std::uint32_t kProfiles[]{100, 110, 122, 244, 44, 83, 86, 118, 128};
  return std::ranges::count(kProfiles, profile) > 0;
}

}  // namespace

// ITU-T H.264, 7.3.2.1.1. Scaling lists are not read: real encoders of cameras have none.
std::optional<PictureSize> size_of_h264(ConstBytes annex_b) {
  for (const ConstBytes unit : nal_units(annex_b)) {
    if (kind_of(unit) != NalKind::kSequenceParameters) continue;
    Bits bits(unit.subspan(1));
    const std::uint32_t profile = bits.take(8);
    bits.take(16);
    bits.take_number();
    std::uint32_t chroma = 1;
    if (states_chroma(profile)) {
      chroma = bits.take_number();
      if (chroma == 3) bits.take(1);
      bits.take_number();
      bits.take_number();
      bits.take(1);
      if (bits.take(1) != 0) return std::nullopt;
    }
    bits.take_number();
    const std::uint32_t order = bits.take_number();
    if (order == 0) bits.take_number();
    if (order == 1) return std::nullopt;
    bits.take_number();
    bits.take(1);
    const std::uint32_t width = (std::min(bits.take_number(), kSizeMax) + 1) * 16;
    const std::uint32_t units = std::min(bits.take_number(), kSizeMax) + 1;
    const bool is_progressive = bits.take(1) != 0;
    const std::uint32_t height = units * 16 * (is_progressive ? 1 : 2);
    if (!is_progressive) bits.take(1);
    bits.take(1);
    PictureSize size{width, height};
    if (bits.take(1) == 0) return size;
    const std::uint32_t step_x = chroma == 1 || chroma == 2 ? 2 : 1;
    const std::uint32_t step_y = (chroma == 1 ? 2U : 1U) * (is_progressive ? 1U : 2U);
    const std::uint32_t left_right = bits.take_number() + bits.take_number();
    const std::uint32_t top_bottom = bits.take_number() + bits.take_number();
    size.width_px -= std::min(width, step_x * std::min(left_right, kSizeMax));
    size.height_px -= std::min(height, step_y * std::min(top_bottom, kSizeMax));
    return size;
  }
  return std::nullopt;
}

// ITU-T T.81, B.2.2: a frame header of any kind.
std::optional<PictureSize> size_of_jpeg(ConstBytes jpeg) {
  const auto byte = [&](std::size_t i) { return std::to_integer<std::uint32_t>(jpeg[i]); };
  std::size_t at = 2;
  while (at + 9 <= jpeg.size() && byte(at) == 0xff) {
    const std::uint32_t marker = byte(at + 1);
    const bool is_frame =
        marker >= 0xc0 && marker <= 0xcf && marker != 0xc4 && marker != 0xc8 && marker != 0xcc;
    if (is_frame) {
      return PictureSize{byte(at + 7) << 8 | byte(at + 8), byte(at + 5) << 8 | byte(at + 6)};
    }
    at += 2 + (byte(at + 2) << 8 | byte(at + 3));
  }
  return std::nullopt;
}

}  // namespace rtpm::exports
