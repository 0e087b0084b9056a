#include "rtpm/device_io/found_device.hpp"

#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstdio>

namespace rtpm::device_io {
namespace {

std::string hex(std::uint16_t number) {
  std::array<char, 5> digits{};
  std::snprintf(digits.data(), digits.size(), "%04x", number);
  return digits.data();
}

}  // namespace

std::string missing_right(const std::string& node) {
  if (::access(node.c_str(), R_OK | W_OK) == 0) return {};
  if (errno == ENOENT || errno == ENODEV || errno == ENXIO) return node + ", which is gone";
  return "reading and writing " + node;
}

std::string udev_rule(std::string_view subsystem, std::uint16_t vendor, std::uint16_t product) {
  // The ids are attributes of the USB device, which is the parent of every node except its own.
  const std::string attribute = subsystem == "usb" ? "ATTR" : "ATTRS";
  return "SUBSYSTEM==\"" + std::string(subsystem) + "\", " + attribute + "{idVendor}==\"" +
         hex(vendor) + "\", " + attribute + "{idProduct}==\"" + hex(product) +
         "\", TAG+=\"uaccess\"";
}

std::string rule_remedy(const std::string& udev_rule) {
  return "put the rule '" + udev_rule + "' into " + kUdevRulesFile + " and plug it in again";
}

}  // namespace rtpm::device_io
