#include "rtpm/device_falcon/protocol.hpp"

#include <algorithm>

namespace rtpm::device_falcon {
namespace {

constexpr std::byte kBegin{'<'};
constexpr std::byte kEnd{'>'};
constexpr int kZeroDigit = 'A';
/// Maximum of byte 13: four buttons and three homed bits.
constexpr int kStateMax = 0x7f;
constexpr std::size_t kStateIndex = 13;
constexpr std::size_t kSpareIndex = 14;

int digit_of(std::byte byte) noexcept {
  return std::to_integer<int>(byte) - kZeroDigit;
}

/// Whether `byte` is valid at `index` in a packet from the device. The meaning of byte 14 is
/// unknown, so only the marks are rejected there.
bool may_stand(std::size_t index, std::byte byte) noexcept {
  const int digit = digit_of(byte);
  if (index == 0) return byte == kBegin;
  if (index < kStateIndex) return digit >= 0 && digit <= 0xf;
  if (index == kStateIndex) return digit >= 0 && digit <= kStateMax;
  if (index == kSpareIndex) return byte != kBegin && byte != kEnd;
  return byte == kEnd;
}

/// Writes each value as four digits, the lowest first, each as a letter starting at 'A'.
void put_counts(Packet& packet, const LegCounts& counts) noexcept {
  for (std::size_t i = 0; i < kStateIndex - 1; ++i) {
    const auto bits = static_cast<std::uint16_t>(counts[i / 4]);
    packet[1 + i] = static_cast<std::byte>(kZeroDigit + (bits >> (i % 4 * 4) & 0xf));
  }
}

LegCounts counts_of(std::span<const std::byte, kPacketSize> packet) noexcept {
  std::array<std::uint16_t, 3> bits{};
  for (std::size_t i = 0; i < kStateIndex - 1; ++i) {
    bits[i / 4] = static_cast<std::uint16_t>(bits[i / 4] | digit_of(packet[1 + i]) << (i % 4 * 4));
  }
  return {static_cast<std::int16_t>(bits[0]), static_cast<std::int16_t>(bits[1]),
          static_cast<std::int16_t>(bits[2])};
}

Packet packet_of(const LegCounts& counts, int state) noexcept {
  Packet packet{};
  packet.front() = kBegin;
  put_counts(packet, counts);
  packet[kStateIndex] = static_cast<std::byte>(kZeroDigit + state);
  packet[kSpareIndex] = static_cast<std::byte>(kZeroDigit);
  packet.back() = kEnd;
  return packet;
}

bool is_packet(std::span<const std::byte, kPacketSize> packet) noexcept {
  for (std::size_t i = 0; i < kPacketSize; ++i) {
    if (!may_stand(i, packet[i])) return false;
  }
  return true;
}

}  // namespace

Packet encode(const MotorRequest& request) noexcept {
  LegCounts counts = request.counts;
  for (std::int16_t& count : counts) {
    count = static_cast<std::int16_t>(std::clamp<int>(count, -kMotorCountMax, kMotorCountMax));
  }
  return packet_of(counts, request.flags & 0xf);
}

Packet encode(const EncoderReport& report) noexcept {
  return packet_of(report.counts, (report.buttons & 0xf) | (report.homed & 0b111) << 4);
}

std::optional<EncoderReport> decode_report(
    std::span<const std::byte, kPacketSize> packet) noexcept {
  if (!is_packet(packet)) return std::nullopt;
  const int state = digit_of(packet[kStateIndex]);
  return EncoderReport{.counts = counts_of(packet),
                       .buttons = static_cast<std::uint8_t>(state & 0xf),
                       .homed = static_cast<std::uint8_t>(state >> 4)};
}

std::optional<MotorRequest> decode_request(
    std::span<const std::byte, kPacketSize> packet) noexcept {
  if (!is_packet(packet) || digit_of(packet[kStateIndex]) > 0xf) return std::nullopt;
  return MotorRequest{.counts = counts_of(packet),
                      .flags = static_cast<std::uint8_t>(digit_of(packet[kStateIndex]))};
}

std::size_t strip_status(std::span<std::byte> transfer) noexcept {
  std::size_t size = 0;
  for (std::size_t begin = 0; begin < transfer.size(); begin += kUsbPacketSize) {
    const auto packet = transfer.subspan(begin, std::min(kUsbPacketSize, transfer.size() - begin));
    if (packet.size() <= kFtdiStatusSize) break;
    const auto payload = packet.subspan(kFtdiStatusSize);
    std::copy(payload.begin(), payload.end(), transfer.begin() + static_cast<std::ptrdiff_t>(size));
    size += payload.size();
  }
  return size;
}

std::optional<EncoderReport> PacketParser::push(std::byte byte) noexcept {
  if (!may_stand(size_, byte)) {
    drop();
    // The start mark of the next packet ends a run of dropped bytes. It may follow a truncated
    // packet.
    if (byte != kBegin) return std::nullopt;
  }
  is_dropping_ = false;
  packet_[size_++] = byte;
  if (size_ < kPacketSize) return std::nullopt;
  size_ = 0;
  return decode_report(packet_);
}

void PacketParser::drop() noexcept {
  if (!is_dropping_) ++corrupt_count_;
  is_dropping_ = true;
  size_ = 0;
}

}  // namespace rtpm::device_falcon
