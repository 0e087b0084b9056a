#include "udev_units.hpp"

#include <libudev.h>

#include <charconv>
#include <memory>
#include <string_view>

namespace rtpm::device_evdev {
namespace {

struct Unref {
  void operator()(udev* context) const { udev_unref(context); }
  void operator()(udev_enumerate* enumerate) const { udev_enumerate_unref(enumerate); }
  void operator()(udev_device* device) const { udev_device_unref(device); }
};
template <class T>
using UdevPointer = std::unique_ptr<T, Unref>;

std::string text_of(const char* text) {
  return text == nullptr ? std::string() : std::string(text);
}

/// The first string that is not empty.
std::string either(std::string first, std::string second) {
  return first.empty() ? std::move(second) : std::move(first);
}

bool has_property(udev_device* device, const char* name) {
  return text_of(udev_device_get_property_value(device, name)) == "1";
}

std::uint16_t hex_of(const std::string& text) {
  std::uint16_t number = 0;
  std::from_chars(text.data(), text.data() + text.size(), number, 16);
  return number;
}

FoundUnit found_unit(udev_device* device) {
  // The parent device, which has the hardware's attributes; owned by `device`.
  udev_device* const input =
      udev_device_get_parent_with_subsystem_devtype(device, "input", nullptr);
  const auto attribute = [&](const char* name) {
    return input == nullptr ? std::string() : text_of(udev_device_get_sysattr_value(input, name));
  };
  const auto property = [&](const char* name) {
    return text_of(udev_device_get_property_value(device, name));
  };
  FoundUnit found;
  found.unit.node = text_of(udev_device_get_devnode(device));
  found.unit.name = attribute("name");
  found.unit.serial = either(property("ID_SERIAL_SHORT"), attribute("uniq"));
  found.unit.path = either(property("ID_PATH"), attribute("phys"));
  found.unit.vendor = hex_of(attribute("id/vendor"));
  found.unit.product = hex_of(attribute("id/product"));
  found.unit.is_joystick = has_property(device, "ID_INPUT_JOYSTICK");
  found.is_desktop =
      has_property(device, "ID_INPUT_KEYBOARD") || has_property(device, "ID_INPUT_KEY") ||
      has_property(device, "ID_INPUT_MOUSE") || has_property(device, "ID_INPUT_TOUCHPAD") ||
      has_property(device, "ID_INPUT_SWITCH");
  return found;
}

}  // namespace

std::vector<FoundUnit> list_units() {
  std::vector<FoundUnit> found;
  const UdevPointer<udev> context(udev_new());
  if (!context) return found;
  const UdevPointer<udev_enumerate> enumerate(udev_enumerate_new(context.get()));
  if (!enumerate) return found;
  udev_enumerate_add_match_subsystem(enumerate.get(), "input");
  udev_enumerate_add_match_sysname(enumerate.get(), "event*");
  udev_enumerate_scan_devices(enumerate.get());
  udev_list_entry* entry = udev_enumerate_get_list_entry(enumerate.get());
  for (; entry != nullptr; entry = udev_list_entry_get_next(entry)) {
    const UdevPointer<udev_device> device(
        udev_device_new_from_syspath(context.get(), udev_list_entry_get_name(entry)));
    // Devices have properties only if udev is running, so this does not filter by properties.
    if (device && udev_device_get_devnode(device.get()) != nullptr) {
      found.push_back(found_unit(device.get()));
    }
  }
  return found;
}

}  // namespace rtpm::device_evdev
