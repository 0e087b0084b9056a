#include "inventory.hpp"

#include <algorithm>
#include <filesystem>
#include <iterator>
#include <map>
#include <set>

#include "rtpm/base/printable.hpp"

namespace rtpm::deviced {
namespace {

constexpr std::size_t kNameWidth = 11;

std::string padded(std::string_view text) {
  std::string cell(text);
  cell.resize(std::max(cell.size() + 1, kNameWidth), ' ');
  return cell;
}

/// Puts the text in quotes, so that a shell reads it as one word: those of Windows know double ones.
std::string as_one_word(std::string_view text) {
  constexpr bool kIsWindows = std::filesystem::path::preferred_separator == '\\';
  const char quote = kIsWindows ? '"' : '\'';
  const std::string within = kIsWindows ? "\"\"" : "'\\''";
  std::string word(1, quote);
  for (const char letter : text)
    word += letter == quote ? within : std::string(1, letter);
  return word + quote;
}

/// The names of the drivers that look for devices: "evdev, hid".
std::string looking(std::span<const DriverInfo> drivers) {
  std::string names;
  for (const DriverInfo& info : drivers) {
    if (info.probe != nullptr) names += (names.empty() ? "" : ", ") + std::string(info.name);
  }
  return names;
}

/// @param name  an unused name for this device: "falcon0"
std::string paragraph(const device_io::FoundDevice& device, const std::string& name) {
  std::string text = padded(device.driver) + printable(device.model);
  if (!device.serial.empty()) text += ", serial " + printable(device.serial);
  text += ", at " + printable(device.node) + "\n";
  const std::string indent(kNameWidth, ' ');
  if (!device.refusal.empty())
    return text + indent + "not served: " + printable(device.refusal) + "\n";
  text += indent + "rtpm-deviced --devices " + name + " --device-" + name + "-arguments " +
          printable(as_one_word(device.arguments)) + "\n";
  if (!device.left_out.empty()) {
    text += indent + "left out: " + printable(device.left_out) + "\n";
  }
  if (!device.missing_right.empty()) {
    text += indent + "missing: " + printable(device.missing_right) + "\n";
  }
  return text;
}

}  // namespace

std::string list_text(std::span<const DriverInfo> drivers) {
  std::string text;
  for (const DriverInfo& info : drivers) {
    text += padded(info.name) + info.devices;
    if (info.make == nullptr && *info.package == '\0') {
      text += " (on Linux only)";
    } else if (info.make == nullptr) {
      text += std::string(" (not in this build; it needs the Debian package ") + info.package + ")";
    }
    text += '\n';
  }
  return text;
}

std::vector<device_io::FoundDevice> probe(std::span<const DriverInfo> drivers) {
  std::vector<device_io::FoundDevice> devices;
  for (const DriverInfo& info : drivers) {
    if (info.probe != nullptr) std::ranges::move(info.probe(), std::back_inserter(devices));
  }
  return devices;
}

std::string probe_text(const std::vector<device_io::FoundDevice>& devices,
                       std::span<const DriverInfo> drivers) {
  if (devices.empty()) {
    const std::string names = looking(drivers);
    return (names.empty() ? "no driver of this build looks for devices"
                          : "no device is plugged in that one of these drivers takes: " + names) +
           "; --list-drivers lists all drivers\n";
  }
  std::string text;
  std::map<std::string, int> counts;
  std::set<std::string> rules;
  for (const device_io::FoundDevice& device : devices) {
    const int number = device.refusal.empty() ? counts[device.driver]++ : 0;
    text += paragraph(device, device.driver + std::to_string(number));
    const bool is_to_open = device.refusal.empty() && !device.missing_right.empty();
    if (is_to_open && !device.udev_rule.empty()) rules.insert(device.udev_rule);
  }
  if (rules.empty()) return text;
  text +=
      std::string("\nTo get the missing rights, put into ") + device_io::kUdevRulesFile + "\n\n";
  for (const std::string& rule : rules)
    text += "    " + printable(rule) + "\n";
  return text + "\nthen run 'udevadm control --reload && udevadm trigger' as root.\n";
}

}  // namespace rtpm::deviced
