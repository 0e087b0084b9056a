#include "guest.hpp"

#include <filesystem>
#include <fstream>
#include <string_view>
#include <system_error>

namespace rtpm::vm_test {
namespace {

constexpr std::string_view kRemedy = " is missing here; ./dev test-vm runs this test in a guest";

}  // namespace

std::string hidraw_node(const std::string& serial_number) {
  std::error_code gone;
  for (const auto& entry : std::filesystem::directory_iterator("/sys/class/hidraw", gone)) {
    std::ifstream properties(entry.path() / "device/uevent");
    for (std::string line; std::getline(properties, line);) {
      if (line == "HID_UNIQ=" + serial_number) return "/dev/" + entry.path().filename().string();
    }
  }
  return {};
}

std::string wait_for_hidraw_node(const std::string& serial_number) {
  std::string node;
  const bool is_found = await([&] {
    node = hidraw_node(serial_number);
    return !node.empty() && std::filesystem::exists(node);
  });
  return is_found ? node : "";
}

std::string missing_uhid() {
  return std::filesystem::exists("/dev/uhid") ? "" : "/dev/uhid" + std::string(kRemedy);
}

std::string missing_vhci() {
  const std::string folder = "/sys/devices/platform/vhci_hcd.0";
  return std::filesystem::exists(folder) ? "" : folder + std::string(kRemedy);
}

}  // namespace rtpm::vm_test
