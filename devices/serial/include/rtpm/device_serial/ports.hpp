#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "rtpm/device_serial/transport.hpp"

namespace rtpm::device_serial {

/// A serial port of this machine.
struct Port {
  std::string node;  ///< For example "/dev/ttyACM0".
  bool is_usb = false;
  std::uint16_t usb_vendor = 0;
  std::uint16_t usb_product = 0;
  std::string model{};   ///< For example "Arduino Uno"; empty if unknown.
  std::string serial{};  ///< The serial number of the USB interface; may be empty.
};

/// Lists the ports of this machine.
/// @realtime set-up only
using ListPorts = std::function<std::vector<Port>()>;
[[nodiscard]] std::vector<Port> list_ports();

/// The port of the board that `settings` select: the port they name, the one with their serial
/// number, or the only USB port.
/// @realtime set-up only
/// @errors   not plugged in; several with this serial number; several ports, and the settings
///           select none
[[nodiscard]] expected<Port, SetupError> choose_port(const PortSettings& settings,
                                                     std::span<const Port> ports);

/// Chooses the port and opens it with libserialport: 8 bits, no parity, one stop bit, no flow
/// control, DTR set.
/// @errors   (from the result) those of choose_port(); no permission for the node, in use,
///           unsupported speed
[[nodiscard]] OpenTransport open_serial_port(ListPorts list = &list_ports);

}  // namespace rtpm::device_serial
