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
  std::string node;  ///< "/dev/ttyACM0".
  bool is_usb = false;
  std::uint16_t usb_vendor = 0;
  std::uint16_t usb_product = 0;
  std::string model{};   ///< "Arduino Uno"; empty if it states none.
  std::string serial{};  ///< The USB interface's serial number; may be empty.
};

/// Lists the ports of this machine.
/// @realtime set-up only
using ListPorts = std::function<std::vector<Port>()>;
[[nodiscard]] std::vector<Port> list_ports();

/// The port of the board that `settings` name: the stated one, the one with the serial number, or
/// the only USB one.
/// @realtime set-up only
/// @errors   not plugged in; several with this serial number; several, and none is named
[[nodiscard]] expected<Port, SetupError> choose_port(const PortSettings& settings,
                                                     std::span<const Port> ports);

/// Chooses the port and opens it with libserialport: 8 bits, no parity, one stop bit, no flow
/// control, DTR set.
/// @errors   the result's: as choose_port(), no right to the node, in use, no such speed
[[nodiscard]] OpenTransport open_serial_port(ListPorts list = &list_ports);

}  // namespace rtpm::device_serial
