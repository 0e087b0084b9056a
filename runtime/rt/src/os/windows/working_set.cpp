#include "working_set.hpp"

namespace rtpm::rt::os {
namespace {

// Users have the right to larger working sets, but it is off until a program asks for it.
void enable_right() noexcept {
  HANDLE token = nullptr;
  if (OpenProcessToken(GetCurrentProcess(), TOKEN_ADJUST_PRIVILEGES, &token) == 0) return;
  TOKEN_PRIVILEGES wanted{};
  wanted.PrivilegeCount = 1;
  wanted.Privileges[0].Attributes = SE_PRIVILEGE_ENABLED;
  if (LookupPrivilegeValueW(nullptr, L"SeIncreaseWorkingSetPrivilege",
                            &wanted.Privileges[0].Luid) != 0) {
    AdjustTokenPrivileges(token, FALSE, &wanted, 0, nullptr, nullptr);
  }
  CloseHandle(token);
}

}  // namespace

DWORD set_working_set(SIZE_T least, SIZE_T most, DWORD flags) noexcept {
  static const bool is_enabled = (enable_right(), true);
  static_cast<void>(is_enabled);
  const bool is_set = SetProcessWorkingSetSizeEx(GetCurrentProcess(), least, most, flags) != 0;
  return is_set ? ERROR_SUCCESS : GetLastError();
}

}  // namespace rtpm::rt::os
