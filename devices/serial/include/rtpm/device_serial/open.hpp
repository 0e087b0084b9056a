#pragma once

#include <memory>
#include <string_view>
#include <vector>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/device_io/found_device.hpp"
#include "rtpm/device_serial/board.hpp"
#include "rtpm/device_serial/ports.hpp"
#include "rtpm/driver/driver.hpp"

namespace rtpm::device_serial {

/// The board that results from the firmware in this folder: a paddle with a motor. It is the
/// default description of a board that is not plugged in when its driver is created.
[[nodiscard]] BoardDescription fallback_board();

/// @errors   an unknown word, a speed that is not a number
[[nodiscard]] expected<PortSettings, SetupError> read_settings(std::string_view arguments);

/// Creates the driver of one board. If the board is plugged in, the driver requests its
/// description, which takes up to 5 s; otherwise it assumes fallback_board().
/// @param arguments    "port=/dev/ttyACM0 speed=115200 serial=12345", each word optional
/// @param device_name  the first part of the frame's name
/// @realtime set-up only
/// @errors   those of read_settings()
[[nodiscard]] expected<std::unique_ptr<driver::Driver>, SetupError> open(
    std::string_view arguments, std::string_view device_name);

/// Creates the driver of one board with a test's ports and transport.
[[nodiscard]] expected<std::unique_ptr<driver::Driver>, SetupError> open(
    std::string_view arguments, std::string_view device_name, const ListPorts& list,
    const OpenTransport& open_transport);

/// The USB serial ports of this machine, even if a board may not speak RTPM's frames: asking it
/// would reset it.
/// @realtime set-up only
[[nodiscard]] std::vector<device_io::FoundDevice> probe();

}  // namespace rtpm::device_serial
