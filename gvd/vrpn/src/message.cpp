#include "rtpm/vrpn/message.hpp"

#include <algorithm>
#include <cstring>
#include <string_view>

#include "network_order.hpp"

namespace rtpm::vrpn {
namespace {

constexpr std::string_view kMagic = "vrpn: ver. 07.38  0";
constexpr std::size_t kMajorSize = std::string_view("vrpn: ver. 07.").size();

constexpr std::size_t padded(std::size_t size) noexcept {
  return (size + 7) / 8 * 8;
}

}  // namespace

std::array<std::byte, kCookieSize> cookie() noexcept {
  std::array<std::byte, kCookieSize> bytes{};
  std::memcpy(bytes.data(), kMagic.data(), kMagic.size());
  return bytes;
}

bool is_cookie(ConstBytes bytes) noexcept {
  return bytes.size() >= kCookieSize && std::memcmp(bytes.data(), kMagic.data(), kMajorSize) == 0;
}

void append(std::vector<std::byte>& to, const Message& message, std::uint32_t number) {
  const std::size_t begin = to.size();
  // The length is that of header and payload without the padding, which the receiver infers.
  put_u32(to, static_cast<std::uint32_t>(kHeaderSize + message.payload.size()));
  put_u32(to, static_cast<std::uint32_t>(message.time_us / 1'000'000));
  put_u32(to, static_cast<std::uint32_t>(message.time_us % 1'000'000));
  put_u32(to, static_cast<std::uint32_t>(message.sender));
  put_u32(to, static_cast<std::uint32_t>(message.type));
  put_u32(to, number);
  to.insert(to.end(), message.payload.begin(), message.payload.end());
  to.resize(begin + padded(kHeaderSize + message.payload.size()));
}

std::optional<Message> Parser::next() {
  bytes_.erase(bytes_.begin(), bytes_.begin() + static_cast<std::ptrdiff_t>(taken_));
  taken_ = 0;
  if (is_broken_ || bytes_.size() < kHeaderSize) return std::nullopt;
  const std::size_t size = u32_at(bytes_, 0);
  if (size < kHeaderSize || size > kHeaderSize + kPayloadSizeMax) {
    is_broken_ = true;
    return std::nullopt;
  }
  if (bytes_.size() < padded(size)) return std::nullopt;
  taken_ = padded(size);
  return Message{.sender = static_cast<std::int32_t>(u32_at(bytes_, 12)),
                 .type = static_cast<std::int32_t>(u32_at(bytes_, 16)),
                 .time_us = std::int64_t{u32_at(bytes_, 4)} * 1'000'000 + u32_at(bytes_, 8),
                 .payload = ConstBytes(bytes_).subspan(kHeaderSize, size - kHeaderSize)};
}

}  // namespace rtpm::vrpn
