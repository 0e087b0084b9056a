#include "os/environment.hpp"

#include <windows.h>

#include <filesystem>
#include <string_view>

namespace rtpm::options::os {

std::vector<std::string> environment() {
  std::vector<std::string> variables;
  wchar_t* const block = GetEnvironmentStringsW();
  if (block == nullptr) return variables;
  for (const wchar_t* at = block; *at != L'\0';) {
    const std::wstring_view variable(at);
    const std::u8string text = std::filesystem::path(variable).u8string();
    variables.emplace_back(text.begin(), text.end());
    at += variable.size() + 1;
  }
  FreeEnvironmentStringsW(block);
  return variables;
}

}  // namespace rtpm::options::os
