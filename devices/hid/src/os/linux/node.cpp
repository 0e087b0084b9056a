#include "node.hpp"

#include <algorithm>
#include <fstream>
#include <iterator>

namespace rtpm::device_hid {
namespace {

std::string sysfs_folder(const std::string& node) {
  return "/sys/class/hidraw/" + node.substr(node.rfind('/') + 1) + "/device/";
}

}  // namespace

std::string port_of(const std::string& node) {
  constexpr std::string_view kKey = "HID_PHYS=";
  std::ifstream file(sysfs_folder(node) + "uevent");
  for (std::string line; std::getline(file, line);) {
    if (line.starts_with(kKey)) return line.substr(kKey.size());
  }
  return {};
}

std::vector<std::byte> report_descriptor_of(const std::string& node) {
  std::ifstream file(sysfs_folder(node) + "report_descriptor", std::ios::binary);
  std::vector<std::byte> bytes;
  std::transform(std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>(),
                 std::back_inserter(bytes), [](char c) { return static_cast<std::byte>(c); });
  return bytes;
}

ReportSizes report_sizes_of(const Unit&) {
  return {};
}

}  // namespace rtpm::device_hid
