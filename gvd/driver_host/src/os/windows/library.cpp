#include "os/library.hpp"

// Windows' own header first: the other builds on it.
#include <windows.h>

#include <psapi.h>

#include <filesystem>
#include <system_error>

#include "rtpm/base/utf8_path.hpp"

namespace rtpm::driver_host {
namespace {

HMODULE module_of(void* handle) noexcept {
  return static_cast<HMODULE>(handle);
}

}  // namespace

expected<std::shared_ptr<Library>, std::string> Library::load(const std::string& file) {
  // With a whole path, the libraries beside the plug-in are found, too.
  std::error_code error;
  auto path = std::filesystem::absolute(path_of_utf8(file), error);
  if (error) return unexpected{error.message()};
  constexpr DWORD kPlaces = LOAD_LIBRARY_SEARCH_DLL_LOAD_DIR | LOAD_LIBRARY_SEARCH_DEFAULT_DIRS;
  // No message box for a library that is missing or damaged.
  DWORD before = 0;
  SetThreadErrorMode(SEM_FAILCRITICALERRORS, &before);
  const HMODULE module = LoadLibraryExW(path.make_preferred().c_str(), nullptr, kPlaces);
  error.assign(static_cast<int>(GetLastError()), std::system_category());
  SetThreadErrorMode(before, nullptr);
  if (module == nullptr) return unexpected{error.message()};
  return std::make_shared<Library>(module, file);
}

Library::~Library() {
  FreeLibrary(module_of(handle_));
}

const void* Library::symbol(const char* name) const noexcept {
  return reinterpret_cast<const void*>(GetProcAddress(module_of(handle_), name));
}

void Library::name_code_around(const void*) {
  MODULEINFO module{};
  if (GetModuleInformation(GetCurrentProcess(), module_of(handle_), &module, sizeof module) == 0)
    return;
  code_name_.emplace(module.lpBaseOfDll, module.SizeOfImage, name_.c_str());
}

}  // namespace rtpm::driver_host
