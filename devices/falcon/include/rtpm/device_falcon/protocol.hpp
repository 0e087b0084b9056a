#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

/// The bytes between a host and a Novint Falcon: packets of 16 bytes in both directions, through an
/// FTDI chip that prefixes each USB packet to the host with two status bytes.
/// @source   libnifalcon's FalconFirmwareNovintSDK and FalconCommLibUSB; FTDI's AN232B-04
namespace rtpm::device_falcon {

inline constexpr std::size_t kPacketSize = 16;
inline constexpr std::size_t kUsbPacketSize = 64;
inline constexpr std::size_t kFtdiStatusSize = 2;  ///< Bytes before each USB packet to the host.
inline constexpr int kMotorCountMax = 4095;

/// One number per leg of the parallel mechanism.
using LegCounts = std::array<std::int16_t, 3>;
using Packet = std::array<std::byte, kPacketSize>;

/// Flags in a packet to the device.
/// @source   libnifalcon's code, which differs from the comment in its header
inline constexpr std::uint8_t kHomingFlag = 0x01;
inline constexpr std::uint8_t kGreenLedFlag = 0x02;
inline constexpr std::uint8_t kBlueLedFlag = 0x04;
inline constexpr std::uint8_t kRedLedFlag = 0x08;

/// The contents of one packet from the device.
/// @ownership plain value, trivially copyable
struct EncoderReport {
  LegCounts counts{};
  std::uint8_t buttons = 0;  ///< Bit 0: plus, 1: forward, 2: centre, 3: minus.
  std::uint8_t homed = 0;    ///< Bit i: leg i has found its reference.
  [[nodiscard]] bool is_homed() const noexcept { return homed == 0b111; }
};

/// The contents of one packet from the host.
/// @ownership plain value, trivially copyable
struct MotorRequest {
  LegCounts counts{};
  std::uint8_t flags = 0;
};

/// Encodes a packet, with counts limited to kMotorCountMax so that no value wraps.
/// @realtime alloc-free
[[nodiscard]] Packet encode(const MotorRequest& request) noexcept;
/// Encodes a packet of the device, for the device model.
[[nodiscard]] Packet encode(const EncoderReport& report) noexcept;
/// Decodes one packet; nullopt if the bytes are not a packet.
/// @realtime alloc-free
[[nodiscard]] std::optional<EncoderReport> decode_report(
    std::span<const std::byte, kPacketSize> packet) noexcept;
[[nodiscard]] std::optional<MotorRequest> decode_request(
    std::span<const std::byte, kPacketSize> packet) noexcept;

/// Removes the status bytes of each USB packet in a transfer, in place. A transfer consists of
/// whole USB packets, of which only the last may be short.
/// @return the payload's size; the payload is at the start of `transfer`
/// @realtime alloc-free
[[nodiscard]] std::size_t strip_status(std::span<std::byte> transfer) noexcept;

/// Finds packets in a byte stream, skipping any other bytes. It stores at most one packet.
/// @threads  one at a time
/// @realtime alloc-free
class PacketParser {
 public:
  /// Calls `on_report` with each packet that `bytes` completes.
  template <class OnReport>
  void push(std::span<const std::byte> bytes, OnReport&& on_report) {
    for (const std::byte byte : bytes) {
      if (const auto report = push(byte)) on_report(*report);
    }
  }
  /// Discards an incomplete packet.
  void reset() noexcept { size_ = 0; }
  /// How many times bytes were dropped; consecutive dropped bytes count once.
  [[nodiscard]] std::uint64_t corrupt_count() const noexcept { return corrupt_count_; }

 private:
  [[nodiscard]] std::optional<EncoderReport> push(std::byte byte) noexcept;
  void drop() noexcept;

  Packet packet_{};
  std::size_t size_ = 0;
  bool is_dropping_ = false;
  std::uint64_t corrupt_count_ = 0;
};

}  // namespace rtpm::device_falcon
