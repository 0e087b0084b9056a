#include "rtpm/rt/secret_memory.hpp"

#include <windows.h>

#include <string>
#include <system_error>
#include <utility>

#include "module.hpp"
#include "rtpm/rt/report.hpp"
#include "working_set.hpp"

namespace rtpm::rt {
namespace {

void note_lock(DWORD error) {
  constexpr const char* kSubject = "memory of keys";
  if (error == ERROR_SUCCESS) {
    note_setup({kSubject, Grant::kGranted, "it is locked, and is never swapped out", ""});
  } else {
    note_setup({kSubject, Grant::kRefused,
                "it can't be locked (" + std::system_category().message(static_cast<int>(error)) +
                    "): keys of sessions may be swapped out",
                "give the user the right 'Increase a process working set' (secpol.msc: Local "
                "Policies, User Rights Assignment), or encrypt the drive of the paging file"});
  }
}

/// Locks the memory; returns the system's error. Locked pages count against the working set's
/// minimum, which is raised by them.
DWORD lock(void* begin, std::size_t size) noexcept {
  if (VirtualLock(begin, size) != 0) return ERROR_SUCCESS;
  SIZE_T least = 0;
  SIZE_T most = 0;
  GetProcessWorkingSetSize(GetCurrentProcess(), &least, &most);
  const DWORD error = os::set_working_set(least + size, most + size, 0);
  if (error != ERROR_SUCCESS) return error;
  return VirtualLock(begin, size) != 0 ? ERROR_SUCCESS : GetLastError();
}

// Error reports leave such memory out, from Windows 10, version 1703, on.
void leave_out_of_reports(const void* begin, std::size_t size) noexcept {
  using Exclude = HRESULT WINAPI(const void*, DWORD);
  static auto* const exclude = os::kernel_function<Exclude>("WerRegisterExcludedMemoryBlock");
  if (exclude != nullptr) static_cast<void>(exclude(begin, static_cast<DWORD>(size)));
}
void forget_in_reports(const void* begin) noexcept {
  using Include = HRESULT WINAPI(const void*);
  static auto* const include = os::kernel_function<Include>("WerUnregisterExcludedMemoryBlock");
  if (include != nullptr) static_cast<void>(include(begin));
}

}  // namespace

SecretMemory::SecretMemory(std::size_t size) {
  if (size == 0) return;
  void* const begin = VirtualAlloc(nullptr, size, MEM_RESERVE | MEM_COMMIT, PAGE_READWRITE);
  if (begin == nullptr) return;
  leave_out_of_reports(begin, size);
  bytes_ = {static_cast<std::byte*>(begin), size};
  note_lock(lock(begin, size));
  // Touched, so that it is resident if it is not locked.
  SecureZeroMemory(begin, size);
}

SecretMemory::SecretMemory(SecretMemory&& other) noexcept
    : bytes_(std::exchange(other.bytes_, {})) {}

SecretMemory& SecretMemory::operator=(SecretMemory&& other) noexcept {
  std::swap(bytes_, other.bytes_);
  return *this;
}

SecretMemory::~SecretMemory() {
  if (bytes_.empty()) return;
  SecureZeroMemory(bytes_.data(), bytes_.size());
  forget_in_reports(bytes_.data());
  VirtualFree(bytes_.data(), 0, MEM_RELEASE);
}

}  // namespace rtpm::rt
