#include "rtpm/wire/sealed.hpp"

#include <string_view>

#include "rtpm/base/assert.hpp"

namespace rtpm::wire {
namespace {

constexpr std::size_t kFlagsOffset = 6;
constexpr std::string_view kProtocol = "H-Protocol 1.0 S";
constexpr std::uint32_t kFeaturesKnown = kFeatureSealed | kFeatureAesGcm;

std::uint16_t flags_of(ConstBytes frame) noexcept {
  return load_le<std::uint16_t>(frame.data() + kFlagsOffset);
}

// sec-3-2: a suite's bit requires the bit for sealing.
bool has_good_features(std::uint32_t features) noexcept {
  return (features & kFeatureSealed) != 0 && (features & ~kFeaturesKnown) == 0;
}

}  // namespace

// sec-3.4-1
Prologue prologue_of(const Header& header, std::span<const std::byte, Hello::kSize> hello,
                     ConstBytes cookie) noexcept {
  RTPM_ASSERT(cookie.empty() || cookie.size() == SealedCookie::kSize, "a COOKIE has its size");
  Prologue prologue{};
  ByteWriter writer(prologue);
  writer.put_bytes(std::as_bytes(std::span(kProtocol)));
  writer.put(header.priority.value());
  writer.put(header.call_id);
  writer.put_bytes(hello);
  writer.put_bytes(cookie);
  return prologue;
}

void encode(const SealedCookie& cookie, MutableBytes to) noexcept {
  ByteWriter writer(to);
  writer.put_bytes(cookie.cookie);
  writer.put_bytes(cookie.server_key);
  writer.put(cookie.suites);
  writer.put_zeros(4);
  RTPM_ASSERT(writer.ok() && writer.size() == SealedCookie::kSize, "COOKIE has its size");
}

// sec-3.1-2
std::optional<SealedCookie> decode_sealed_cookie(ConstBytes payload) noexcept {
  if (payload.size() != SealedCookie::kSize) return std::nullopt;
  ByteReader reader(payload);
  SealedCookie cookie;
  std::ranges::copy(reader.take_bytes(cookie.cookie.size()), cookie.cookie.begin());
  std::ranges::copy(reader.take_bytes(cookie.server_key.size()), cookie.server_key.begin());
  cookie.suites = reader.take<std::uint32_t>();
  if (!reader.take_zeros(4)) return std::nullopt;
  return cookie;
}

// sec-3.2-1
std::optional<SealedHello> decode_sealed_hello(ConstBytes payload) noexcept {
  if (payload.size() != SealedHello::kSize) return std::nullopt;
  const auto hello = decode_hello(payload.first(Hello::kSize));
  if (!hello || !has_good_features(hello->features)) return std::nullopt;
  return SealedHello{
      *hello, std::span<const std::byte, SealedHello::kMessageSize>(payload.subspan(Hello::kSize))};
}

void encode(const SealedWelcome& inner, MutableBytes to) noexcept {
  store_le(to.data(), inner.session);
  encode(inner.welcome, to.subspan(8, Welcome::kSize));
  ByteWriter writer(to.subspan(8 + Welcome::kSize));
  writer.put(static_cast<std::uint8_t>(inner.former));
  writer.put_zeros(7);
}

// sec-3.3-1
std::optional<SealedWelcome> decode_sealed_welcome(ConstBytes inner,
                                                   std::uint32_t features) noexcept {
  if (inner.size() != SealedWelcome::kInnerSize) return std::nullopt;
  SealedWelcome sealed;
  sealed.session = load_le<std::uint64_t>(inner.data());
  const auto welcome = decode_welcome(inner.subspan(8, Welcome::kSize), features);
  ByteReader reader(inner.subspan(8 + Welcome::kSize));
  const auto former = reader.take<std::uint8_t>();
  if (!welcome || !has_good_features(welcome->features) || welcome->features != features ||
      sealed.session == 0 || former > static_cast<std::uint8_t>(FormerSession::kEnded) ||
      !reader.take_zeros(7)) {
    return std::nullopt;
  }
  sealed.welcome = *welcome;
  sealed.former = static_cast<FormerSession>(former);
  return sealed;
}

bool is_sealed(ConstBytes frame) noexcept {
  return frame.size() >= kHeaderSize && (flags_of(frame) & kFlagSealed) != 0;
}

std::size_t frame_size(ConstBytes bytes) noexcept {
  if (!is_sealed(bytes)) {
    const auto header = decode(bytes);
    return header ? kHeaderSize + header->payload_size : 0;
  }
  std::array<std::byte, kHeaderSize> copy;
  std::ranges::copy(bytes.first(kHeaderSize), copy.begin());
  unmark_sealed(copy.data());
  const auto header = decode(copy);
  return header ? kHeaderSize + header->payload_size + kSealedTrailerSize : 0;
}

void mark_sealed(std::byte* frame) noexcept {
  store_le<std::uint16_t>(
      frame + kFlagsOffset,
      static_cast<std::uint16_t>(load_le<std::uint16_t>(frame + kFlagsOffset) | kFlagSealed));
}

void unmark_sealed(std::byte* frame) noexcept {
  store_le<std::uint16_t>(
      frame + kFlagsOffset,
      static_cast<std::uint16_t>(load_le<std::uint16_t>(frame + kFlagsOffset) & ~kFlagSealed));
}

// sec-4-1, sec-4-2, sec-4-4: the checks of an ordinary frame, in the same order, on a copy of the
// header without the flag, which ordinary frames lack.
expected<void, DropReason> decode_sealed_frame(ConstBytes frame, Medium medium,
                                               Header& header) noexcept {
  if (frame.size() < kHeaderSize) return unexpected{DropReason::kTooShort};
  std::array<std::byte, kHeaderSize> copy;
  std::ranges::copy(frame.first(kHeaderSize), copy.begin());
  unmark_sealed(copy.data());
  const auto read = decode(copy);
  if (!read) return unexpected{read.error()};
  if (!is_sealed(frame)) return unexpected{DropReason::kUnsealed};
  // Only frames of sessions are sealed, not handshakes, which have no keys yet.
  switch (read->kind) {
    case FrameKind::kHello:
    case FrameKind::kCookie:
    case FrameKind::kWelcome:
      return unexpected{DropReason::kReservedSet};
    default:
      break;
  }
  if (read->payload_size + kSealedTrailerSize != frame.size() - kHeaderSize ||
      read->payload_size > sealed_payload_max(medium)) {
    return unexpected{DropReason::kBadLength};
  }
  header = *read;
  return {};
}

}  // namespace rtpm::wire
