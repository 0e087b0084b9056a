#include "rtpm/device_serial/ports.hpp"

#include <libserialport.h>

#include <algorithm>
#include <filesystem>
#include <iterator>
#include <system_error>

namespace rtpm::device_serial {
namespace {

std::string text_of(const char* text) {
  return text == nullptr ? "" : text;
}

Port port_of(const sp_port* port) {
  Port found;
  found.node = text_of(sp_get_port_name(port));
  found.is_usb = sp_get_port_transport(port) == SP_TRANSPORT_USB;
  int vendor = 0;
  int product = 0;
  if (found.is_usb && sp_get_port_usb_vid_pid(port, &vendor, &product) == SP_OK) {
    found.usb_vendor = static_cast<std::uint16_t>(vendor);
    found.usb_product = static_cast<std::uint16_t>(product);
  }
  found.model = text_of(sp_get_port_usb_product(port));
  if (found.model.empty()) found.model = text_of(sp_get_port_description(port));
  found.serial = text_of(sp_get_port_usb_serial(port));
  return found;
}

/// Follows a link, such as those in /dev/serial.
std::string target_of(const std::string& node) {
  std::error_code error;
  const std::filesystem::path target = std::filesystem::canonical(node, error);
  return error ? node : target.string();
}

std::string nodes_of(std::span<const Port> ports) {
  std::string nodes;
  for (const Port& port : ports)
    nodes += (nodes.empty() ? "" : ", ") + port.node;
  return nodes;
}

}  // namespace

std::vector<Port> list_ports() {
  sp_port** list = nullptr;
  std::vector<Port> ports;
  if (sp_list_ports(&list) != SP_OK) return ports;
  for (sp_port** port = list; *port != nullptr; ++port)
    ports.push_back(port_of(*port));
  sp_free_port_list(list);
  return ports;
}

expected<Port, SetupError> choose_port(const PortSettings& settings, std::span<const Port> ports) {
  if (!settings.port.empty()) {
    const auto found = std::ranges::find(ports, target_of(settings.port), &Port::node);
    return found == ports.end() ? Port{.node = settings.port} : *found;
  }
  std::vector<Port> fitting;
  std::ranges::copy_if(ports, std::back_inserter(fitting), [&](const Port& port) {
    return settings.serial.empty() ? port.is_usb : port.serial == settings.serial;
  });
  const std::string which =
      settings.serial.empty() ? "a USB serial port" : "a board of serial number " + settings.serial;
  if (fitting.size() == 1) return fitting.front();
  if (fitting.empty())
    return setup_error(which + " is not plugged in", "",
                       "plug the board in, or name another port with 'port='");
  return setup_error(
      "the board is not known for certain",
      std::to_string(fitting.size()) + " ports are " + which + ": " + nodes_of(fitting),
      "name one with 'port=', best by a link in /dev/serial/by-path");
}

}  // namespace rtpm::device_serial
