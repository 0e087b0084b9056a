#pragma once

#include <cstdint>

/// The requests to the Falcon's FTDI chip: vendor requests to the device, without data.
/// @source   FTDI's AN232B-04 and libftdi; the values for the Falcon from libnifalcon
namespace rtpm::device_falcon {

inline constexpr std::uint16_t kVendor = 0x0403;
inline constexpr std::uint16_t kProduct = 0xcb48;
inline constexpr std::uint8_t kEndpointOut = 0x02;
inline constexpr std::uint8_t kEndpointIn = 0x81;
inline constexpr std::uint8_t kVendorRequestType = 0x40;

enum class FtdiRequest : std::uint8_t {
  kReset = 0,
  kModemControl = 1,
  kFlowControl = 2,
  kBaudRate = 3,
  kDataBits = 4,
  kLatencyTimer = 9,  ///< The time in milliseconds after which the chip sends the data it has.
};

/// With kReset: drops the bytes sent to the host.
inline constexpr std::uint16_t kPurgeReceived = 1;
/// With kReset: drops the bytes sent to the device.
inline constexpr std::uint16_t kPurgeTransmitted = 2;
inline constexpr std::uint16_t kDtrLow = 0x0100;
inline constexpr std::uint16_t kDtrHigh = 0x0101;
inline constexpr std::uint16_t kRtsLow = 0x0200;
inline constexpr std::uint16_t kNoFlowControl = 0;
inline constexpr std::uint16_t kEightBitsNoParity = 0x0008;

// Divisors of a clock of 3 MHz.
/// 9600 baud, for the boot loader's greeting.
inline constexpr std::uint16_t kBootDivisor = 0x4138;
inline constexpr std::uint16_t kLoadDivisor = 0x0015;  ///< 142 857 baud, for loading the firmware.
inline constexpr std::uint16_t kRunDivisor = 0x0002;   ///< 1.5 Mbaud, for the firmware's packets.

}  // namespace rtpm::device_falcon
