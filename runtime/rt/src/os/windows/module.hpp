#pragma once

#include <windows.h>

namespace rtpm::rt::os {

/// A function of kernel32.dll that older versions of Windows 10 or the compiler's import library
/// lack; null if it is missing. `F` is its type.
/// @realtime set-up only
template <class F>
[[nodiscard]] F* kernel_function(const char* name) noexcept {
  const HMODULE kernel = GetModuleHandleW(L"kernel32.dll");
  if (kernel == nullptr) return nullptr;
  return reinterpret_cast<F*>(reinterpret_cast<void*>(GetProcAddress(kernel, name)));
}

/// Keeps the module of `code` loaded, because the system will call that later.
/// @realtime set-up only
inline void keep_loaded(const void* code) noexcept {
  HMODULE module = nullptr;
  GetModuleHandleExW(GET_MODULE_HANDLE_EX_FLAG_FROM_ADDRESS | GET_MODULE_HANDLE_EX_FLAG_PIN,
                     static_cast<const wchar_t*>(code), &module);
}

}  // namespace rtpm::rt::os
