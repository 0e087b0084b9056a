#include "rtpm/device_falcon/open.hpp"

#include <cerrno>
#include <fstream>
#include <iterator>
#include <string>
#include <utility>

#include "rtpm/device_falcon/falcon_driver.hpp"
#include "rtpm/device_falcon/start_up.hpp"
#include "rtpm/driver/arguments.hpp"
#include "usb_transport.hpp"

namespace rtpm::device_falcon {
namespace {

expected<std::vector<std::byte>, SetupError> read_firmware(const std::string& path) {
  const std::string what = "the Falcon's firmware " + path + " can't be used";
  errno = 0;
  std::ifstream file(path, std::ios::binary);
  if (!file) return setup_error(what, system_error(errno), "give a file that can be read");
  std::vector<std::byte> bytes;
  char letter = 0;
  while (bytes.size() <= kFirmwareSizeMax && file.get(letter))
    bytes.push_back(static_cast<std::byte>(letter));
  if (bytes.size() < kFirmwareSizeMin || bytes.size() > kFirmwareSizeMax) {
    return setup_error(what, "a Falcon's has 4096 to 16384 bytes",
                       "give a file that you have from the maker's software");
  }
  return bytes;
}

/// Creates a choice that matches this unit on any port it may be plugged into next.
UnitChoice choice_of(const Unit& unit, const UnitChoice& choice) {
  if (!choice.serial.empty() || !choice.port.empty()) return choice;
  if (!unit.serial.empty()) return {.serial = unit.serial};
  return {.port = unit.port};
}

/// Finds and opens the unit; after the first time, always the same unit.
OpenTransport opener(UnitChoice choice) {
  return
      [choice = std::move(choice)]() mutable -> expected<std::unique_ptr<Transport>, SetupError> {
        auto units = find_units();
        if (!units) return unexpected{units.error()};
        const auto index = choose(*units, choice);
        if (!index) return unexpected{index.error()};
        const Unit& unit = (*units)[*index];
        auto transport = open_usb(unit);
        if (transport) choice = choice_of(unit, choice);
        return transport;
      };
}

}  // namespace

expected<std::unique_ptr<driver::Driver>, SetupError> open(std::string_view arguments,
                                                           std::string_view device_name) {
  const auto words = driver::read_words(
      "falcon", arguments, {.names = {"serial", "port"}, .names_to_the_end = {"firmware"}});
  if (!words) return unexpected{words.error()};
  FalconConfig config;
  config.frame = std::string(device_name) + "/base";
  if (const std::string path = driver::value_of(*words, "firmware"); !path.empty()) {
    auto firmware = read_firmware(path);
    if (!firmware) return unexpected{firmware.error()};
    config.firmware = std::move(*firmware);
  }
  UnitChoice choice{.serial = driver::value_of(*words, "serial"),
                    .port = driver::value_of(*words, "port")};
  config.serial = choice.serial;
  if (const auto units = find_units()) {
    if (const auto index = choose(*units, choice)) {
      choice = choice_of((*units)[*index], choice);
      config.serial = (*units)[*index].serial;
    }
  }
  if (config.serial.empty()) config.serial = choice.port.empty() ? "any" : "port-" + choice.port;
  return std::make_unique<FalconDriver>(std::move(config), opener(std::move(choice)));
}

std::vector<device_io::FoundDevice> probe() {
  std::vector<device_io::FoundDevice> found;
  const auto units = find_units();
  if (!units) return found;
  for (const Unit& unit : *units) {
    found.push_back({.driver = "falcon",
                     .model = "Novint Falcon",
                     .serial = unit.serial,
                     .node = unit.node,
                     .arguments = "port=" + unit.port,
                     .missing_right = device_io::missing_right(unit.node),
                     .udev_rule = device_io::udev_rule("usb", kVendor, kProduct)});
  }
  return found;
}

}  // namespace rtpm::device_falcon
