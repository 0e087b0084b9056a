#include "rtpm/device_io/found_device.hpp"

#include <windows.h>

#include "rtpm/base/utf8_path.hpp"

namespace rtpm::device_io {

std::string missing_right(const std::string& node) {
  const HANDLE opened =
      CreateFileW(path_of_utf8(node).c_str(), GENERIC_READ | GENERIC_WRITE,
                  FILE_SHARE_READ | FILE_SHARE_WRITE, nullptr, OPEN_EXISTING, 0, nullptr);
  if (opened != INVALID_HANDLE_VALUE) {
    CloseHandle(opened);
    return {};
  }
  const DWORD error = GetLastError();
  const bool is_held = error == ERROR_SHARING_VIOLATION || error == ERROR_ACCESS_DENIED;
  if (is_held) return "reading and writing " + node + ", which another program holds";
  return node + ", which is gone";
}

std::string udev_rule(std::string_view, std::uint16_t, std::uint16_t) {
  return {};
}

std::string rule_remedy(const std::string&) {
  return "end the program that holds it, such as 3DxWare, Steam or DS4Windows; where HidHide hides "
         "it, allow this program there";
}

}  // namespace rtpm::device_io
