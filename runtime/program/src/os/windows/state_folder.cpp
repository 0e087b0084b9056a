#include "rtpm/program/state_folder.hpp"

#include <windows.h>

#include <array>
#include <filesystem>

#include "rtpm/base/utf8_path.hpp"

namespace rtpm::program {

std::string state_folder() {
  std::array<wchar_t, 4096> value{};
  const DWORD size =
      GetEnvironmentVariableW(L"LOCALAPPDATA", value.data(), static_cast<DWORD>(value.size()));
  if (size == 0 || size >= value.size()) return {};
  return utf8_of(std::filesystem::path(value.data()) / L"rtpm");
}

}  // namespace rtpm::program
