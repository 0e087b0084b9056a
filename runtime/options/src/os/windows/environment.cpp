#include "os/environment.hpp"

#include <windows.h>

#include <filesystem>
#include <string_view>

#include "rtpm/base/utf8_path.hpp"

namespace rtpm::options::os {

std::vector<std::string> environment() {
  std::vector<std::string> variables;
  wchar_t* const block = GetEnvironmentStringsW();
  if (block == nullptr) return variables;
  for (const wchar_t* at = block; *at != L'\0';) {
    const std::wstring_view variable(at);
    variables.push_back(utf8_of(variable));
    at += variable.size() + 1;
  }
  FreeEnvironmentStringsW(block);
  return variables;
}

}  // namespace rtpm::options::os
