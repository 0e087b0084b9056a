#include "rtpm/rt/host.hpp"

#include <windows.h>

#include <bcrypt.h>

#include <algorithm>
#include <array>
#include <bit>
#include <filesystem>

#include "rtpm/base/assert.hpp"
#include "rtpm/base/utf8_path.hpp"

namespace rtpm::rt {

// hp-4.1-7: unknown, so clocks' offsets are measured even within one host.
std::uint64_t clock_domain() noexcept {
  return 0;
}

std::string program_name() {
  std::wstring path(1024, L'\0');
  path.resize(GetModuleFileNameW(nullptr, path.data(), static_cast<DWORD>(path.size())));
  return utf8_of(std::filesystem::path(path).stem());
}

std::string host_name() {
  std::array<wchar_t, 256> name{};
  auto size = static_cast<DWORD>(name.size());
  if (GetComputerNameExW(ComputerNameDnsHostname, name.data(), &size) == 0) return {};
  return utf8_of(name.data());
}

// From the registry, as the calls tell a program without a manifest of an older Windows.
std::string kernel_version() {
  std::array<wchar_t, 32> build{};
  DWORD size = sizeof build;
  const LSTATUS status =
      RegGetValueW(HKEY_LOCAL_MACHINE, L"SOFTWARE\\Microsoft\\Windows NT\\CurrentVersion",
                   L"CurrentBuildNumber", RRF_RT_REG_SZ, nullptr, build.data(), &size);
  return status == ERROR_SUCCESS ? "10.0." + utf8_of(build.data()) : "";
}

std::uint64_t random_u64() noexcept {
  std::uint64_t value = 0;
  while (value == 0) {
    const NTSTATUS status = BCryptGenRandom(nullptr, reinterpret_cast<UCHAR*>(&value), sizeof value,
                                            BCRYPT_USE_SYSTEM_PREFERRED_RNG);
    RTPM_ASSERT(status == 0, "the system gives random bytes");
  }
  return value;
}

// Those of the thread's group: threads are confined within it.
std::vector<int> usable_cpus() {
  GROUP_AFFINITY group{};
  std::vector<int> numbers;
  if (GetThreadGroupAffinity(GetCurrentThread(), &group) == 0) return numbers;
  for (int cpu = 0; cpu < static_cast<int>(8 * sizeof group.Mask); ++cpu) {
    if ((group.Mask >> cpu & 1) != 0) numbers.push_back(cpu);
  }
  return numbers;
}

int usable_cpu_count() noexcept {
  GROUP_AFFINITY group{};
  const bool is_known = GetThreadGroupAffinity(GetCurrentThread(), &group) != 0;
  return is_known ? std::max(1, std::popcount(group.Mask)) : 1;
}

}  // namespace rtpm::rt
