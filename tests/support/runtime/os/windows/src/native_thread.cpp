#include "rtpm/test/native_thread.hpp"

#include <windows.h>

#include <cstdint>

namespace rtpm::test {

Duration process_cpu_time() {
  FILETIME begin{};
  FILETIME end{};
  FILETIME kernel{};
  FILETIME user{};
  GetProcessTimes(GetCurrentProcess(), &begin, &end, &kernel, &user);
  const auto units_of = [](const FILETIME& time) {
    return std::int64_t{time.dwHighDateTime} << 32 | std::int64_t{time.dwLowDateTime};
  };
  return Duration{(units_of(kernel) + units_of(user)) * 100};
}

void block_for(Duration time) {
  Sleep(static_cast<DWORD>(time / std::chrono::milliseconds{1}));
}

Scheduling scheduling_of_this_thread() {
  return {GetThreadPriority(GetCurrentThread())};
}

int number_of_this_thread() {
  return static_cast<int>(GetCurrentThreadId());
}

std::string name_of_this_thread() {
  using GetDescription = HRESULT WINAPI(HANDLE, wchar_t**);
  auto* const get = reinterpret_cast<GetDescription*>(reinterpret_cast<void*>(
      GetProcAddress(GetModuleHandleW(L"kernel32.dll"), "GetThreadDescription")));
  wchar_t* wide = nullptr;
  if (get == nullptr || get(GetCurrentThread(), &wide) < 0) return {};
  std::string name;
  for (const wchar_t* each = wide; *each != 0; ++each)
    name += static_cast<char>(*each);
  LocalFree(wide);
  return name;
}

std::vector<int> cpus_of_this_thread() {
  GROUP_AFFINITY group{};
  GetThreadGroupAffinity(GetCurrentThread(), &group);
  std::vector<int> cpus;
  for (int cpu = 0; cpu < 64; ++cpu) {
    if ((group.Mask >> cpu & 1) != 0) cpus.push_back(cpu);
  }
  return cpus;
}

}  // namespace rtpm::test
