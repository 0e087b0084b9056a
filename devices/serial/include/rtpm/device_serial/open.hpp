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

/// The board that the firmware in this folder makes: a paddle with a motor. It stands in for a
/// board that is not plugged in when its driver is made.
[[nodiscard]] BoardDescription fallback_board();

/// @errors   an unknown word, a speed that is not a number
[[nodiscard]] expected<PortSettings, SetupError> read_settings(std::string_view arguments);

/// The driver of one board. If it is plugged in, it is asked for its description, which takes up to
/// 5 s; otherwise it is taken for fallback_board().
/// @param arguments    "port=/dev/ttyACM0 speed=115200 serial=12345", each word optional
/// @param device_name  begins the name of the frame
/// @realtime set-up only
/// @errors   as read_settings()
[[nodiscard]] expected<std::unique_ptr<driver::Driver>, SetupError> open(
    std::string_view arguments, std::string_view device_name);

/// The driver of one board, with the ports and transport of a test.
[[nodiscard]] expected<std::unique_ptr<driver::Driver>, SetupError> open(
    std::string_view arguments, std::string_view device_name, const ListPorts& list,
    const OpenTransport& open_transport);

/// The USB serial ports of this machine, whether a board speaks RTPM's frames or not: asking one
/// would reset it.
/// @realtime set-up only
[[nodiscard]] std::vector<device_io::FoundDevice> probe();

}  // namespace rtpm::device_serial
