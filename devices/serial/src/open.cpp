#include "rtpm/device_serial/open.hpp"

#include <utility>

#include "rtpm/device_serial/serial_driver.hpp"
#include "rtpm/driver/arguments.hpp"

namespace rtpm::device_serial {
namespace {

/// Returns nullopt if the board is not plugged in or does not answer: configure() reports the
/// reason.
std::optional<BoardDescription> ask(const PortSettings& settings,
                                    const OpenTransport& open_transport) {
  const auto transport = open_transport(settings);
  if (!transport) return std::nullopt;
  Session session(**transport, {std::chrono::milliseconds{1}, settings.speed_baud,
                                nonce_at((*transport)->now())});
  auto board = session.greet();
  if (!board) return std::nullopt;
  return std::move(*board);
}

/// The first of these that is available: the operator's serial number, the USB serial number, the
/// board's own serial number, the port.
std::string serial_of(const PortSettings& settings, const Port* port,
                      const BoardDescription& board) {
  if (!settings.serial.empty()) return settings.serial;
  if (port != nullptr && !port->serial.empty()) return port->serial;
  if (!board.serial.empty()) return board.serial;
  if (!settings.port.empty()) return settings.port;
  return port != nullptr ? port->node : "unknown";
}

std::string arguments_for(const Port& port, std::span<const Port> ports) {
  const auto has_same = [&](const Port& other) { return other.serial == port.serial; };
  const bool is_unique = !port.serial.empty() && port.serial.find(' ') == std::string::npos &&
                         std::ranges::count_if(ports, has_same) == 1;
  return is_unique ? "serial=" + port.serial : "port=" + port.node;
}

}  // namespace

BoardDescription fallback_board() {
  BoardDescription board;
  board.rate_hz = 500;
  board.name = "RTPM paddle";
  board.joints = {
      {.name = "paddle", .unit = "rad", .low = -0.75, .high = 0.75, .effort_max = 0.125}};
  board.analogs = {{.name = "grip", .unit = "1", .low = 0, .high = 1},
                   {.name = "light", .unit = "1", .low = 0, .high = 1}};
  board.buttons = {"button"};
  board.outputs = {{.name = "lamp", .unit = "1", .low = 0, .high = 1, .safe = 0}};
  return board;
}

expected<PortSettings, SetupError> read_settings(std::string_view arguments) {
  const auto words = driver::read_words("serial", arguments, {{"port", "speed", "serial"}});
  if (!words) return unexpected{words.error()};
  PortSettings settings;
  settings.port = driver::value_of(*words, "port");
  settings.serial = driver::value_of(*words, "serial");
  const std::string text = driver::value_of(*words, "speed");
  if (text.empty()) return settings;
  const auto speed_baud = driver::to_number<std::int64_t>(text);
  if (!speed_baud || *speed_baud < SerialDriver::kSpeedMinBaud ||
      *speed_baud > SerialDriver::kSpeedMaxBaud) {
    return setup_error("the driver serial has no speed '" + text + "'", "",
                       "give 9600 to 4000000 baud, as in the board's firmware");
  }
  settings.speed_baud = *speed_baud;
  return settings;
}

expected<std::unique_ptr<driver::Driver>, SetupError> open(std::string_view arguments,
                                                           std::string_view device_name,
                                                           const ListPorts& list,
                                                           const OpenTransport& open_transport) {
  auto settings = read_settings(arguments);
  if (!settings) return unexpected{settings.error()};
  const auto port = choose_port(*settings, list());
  auto board = port ? ask(*settings, open_transport) : std::nullopt;
  SerialConfig config{.open = open_transport,
                      .board = board.value_or(fallback_board()),
                      .frame = std::string(device_name) + "/base"};
  config.serial = serial_of(*settings, port ? &*port : nullptr, config.board);
  // The serial number identifies the board even on another port.
  if (settings->port.empty() && port) settings->serial = port->serial;
  config.port = std::move(*settings);
  return std::make_unique<SerialDriver>(std::move(config));
}

expected<std::unique_ptr<driver::Driver>, SetupError> open(std::string_view arguments,
                                                           std::string_view device_name) {
  return open(arguments, device_name, &list_ports, open_serial_port());
}

std::vector<device_io::FoundDevice> probe() {
  std::vector<device_io::FoundDevice> found;
  const std::vector<Port> ports = list_ports();
  for (const Port& port : ports) {
    if (!port.is_usb) continue;
    found.push_back({.driver = "serial",
                     .model = port.model,
                     .serial = port.serial,
                     .node = port.node,
                     .arguments = arguments_for(port, ports),
                     .missing_right = device_io::missing_right(port.node),
                     .udev_rule = device_io::udev_rule("tty", port.usb_vendor, port.usb_product)});
  }
  return found;
}

}  // namespace rtpm::device_serial
