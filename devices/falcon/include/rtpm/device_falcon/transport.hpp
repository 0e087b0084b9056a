#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/device_falcon/ftdi.hpp"

namespace rtpm::device_falcon {

/// Result of a USB transfer.
enum class UsbStatus : std::uint8_t {
  kOk,
  kTimeout,   ///< Nothing arrived within the patience.
  kBusy,      ///< The previous bytes are still being transferred.
  kStalled,   ///< The device refused the transfer.
  kOverflow,  ///< The device sent more bytes than fit; they are lost.
  kGone,      ///< The device is unplugged, or the bus has failed.
};

/// Result of Transport::receive().
struct Received {
  UsbStatus status = UsbStatus::kTimeout;
  std::size_t size = 0;  ///< Bytes of the transfer, including the FTDI status bytes.
  MonotonicTime time{};  ///< When the transfer completed.
};

/// Size of the longest transfer to the host, so that no device can overflow it.
inline constexpr std::size_t kTransferSize = 512;

/// The USB connection to one unit, and the clock for waiting on it.
/// @threads  one at a time
class Transport {
 public:
  Transport() = default;
  Transport(const Transport&) = delete;
  Transport& operator=(const Transport&) = delete;
  /// Closes the connection.
  virtual ~Transport() = default;

  /// Sends a vendor request and waits for its completion, for at most 100 ms.
  /// @realtime set-up only
  [[nodiscard]] virtual UsbStatus request(FtdiRequest request, std::uint16_t value) = 0;
  /// Starts sending `bytes`, at most kTransferSize; receive() continues the transfer.
  /// @return kBusy if nothing was sent
  [[nodiscard]] virtual UsbStatus send(std::span<const std::byte> bytes) = 0;
  /// Waits for one transfer from the device, for at most `patience`.
  /// @param buffer  must have kTransferSize bytes
  [[nodiscard]] virtual Received receive(std::span<std::byte> buffer, Duration patience) = 0;
  /// The current time; never decreases.
  [[nodiscard]] virtual MonotonicTime now() const = 0;
};

/// Opens the unit.
/// @errors   described in words with the remedy
using OpenTransport = std::function<expected<std::unique_ptr<Transport>, SetupError>()>;

}  // namespace rtpm::device_falcon
