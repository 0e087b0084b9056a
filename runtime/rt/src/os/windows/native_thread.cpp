#include "os/native_thread.hpp"

#include <windows.h>

#include <avrt.h>

#include <algorithm>
#include <array>

#include "module.hpp"
#include "os/crash_facts.hpp"
#include "thread_level.hpp"

// Windows has a few priorities for threads without rights, and a service, MMCSS, that gives up to 32
// threads of a process higher ones. RTPM's levels are ranges of both.
namespace rtpm::rt::os {
namespace {

constexpr int kHighestFrom = 23;
/// From here on a thread is urgent, and MMCSS gives it a level of its own.
constexpr int kUrgentFrom = 45;

/// A range of urgent levels.
struct UrgentRange {
  int from;
  AVRT_PRIORITY priority;
  const char* name;
};
constexpr std::array kUrgentRanges{UrgentRange{78, AVRT_PRIORITY_CRITICAL, "critical"},
                                   UrgentRange{67, AVRT_PRIORITY_HIGH, "high"},
                                   UrgentRange{56, AVRT_PRIORITY_NORMAL, "normal"},
                                   UrgentRange{kUrgentFrom, AVRT_PRIORITY_LOW, "low"}};
/// For the time in which an urgent thread works at a lower level.
constexpr UrgentRange kNotUrgent{0, AVRT_PRIORITY_VERYLOW, "very low"};

const UrgentRange& urgent_range_of(int level) noexcept {
  for (const UrgentRange& range : kUrgentRanges) {
    if (level >= range.from) return range;
  }
  return kNotUrgent;
}

struct SystemPriority {
  int value;
  const char* name;
};
SystemPriority system_priority_of(int level) noexcept {
  if (level >= kUrgentFrom) {
    return {THREAD_PRIORITY_TIME_CRITICAL, "TIME_CRITICAL (base priority 15)"};
  }
  return level >= kHighestFrom
             ? SystemPriority{THREAD_PRIORITY_HIGHEST, "HIGHEST (base priority 10)"}
             : SystemPriority{THREAD_PRIORITY_ABOVE_NORMAL, "ABOVE_NORMAL (base priority 9)"};
}

// The name for crash_facts.hpp: the system's copy can't be read without allocating.
constinit thread_local std::array<char, 16> thread_name{};
// The thread's membership in the multimedia class, if it has one.
constinit thread_local HANDLE multimedia_class = nullptr;
// Only a thread's first request may join that class, which takes a call to another process.
constinit thread_local bool has_level = false;

// Without this, the system may run a program without a window at a low clock rate, and coarsen its
// timers.
void refuse_throttling() noexcept {
  using SetInformation = BOOL WINAPI(HANDLE, int, void*, DWORD);
  constexpr int kProcessPowerThrottling = 4;
  struct {
    ULONG version = 1;
    ULONG control_mask = 0x1 | 0x4;  // The execution speed, and the timer resolution.
    ULONG state_mask = 0;
  } state;
  auto* const set = kernel_function<SetInformation>("SetProcessInformation");
  if (set == nullptr) return;
  if (set(GetCurrentProcess(), kProcessPowerThrottling, &state, sizeof state) != 0) return;
  state.control_mask = 0x1;  // Windows 10 knows only that one.
  set(GetCurrentProcess(), kProcessPowerThrottling, &state, sizeof state);
}

int error_unless(BOOL is_done) noexcept {
  return is_done != 0 ? 0 : static_cast<int>(GetLastError());
}

std::string list_of(const std::vector<int>& numbers) {
  std::string list;
  for (const int number : numbers)
    list += (list.empty() ? "" : ",") + std::to_string(number);
  return list;
}

}  // namespace

void name_this_thread(const std::string& name) noexcept {
  // As many bytes as other systems keep.
  const std::size_t size = std::min(name.size(), thread_name.size() - 1);
  thread_name = {};
  std::copy_n(name.begin(), size, thread_name.begin());
  using SetDescription = HRESULT WINAPI(HANDLE, const wchar_t*);  // Windows 10, version 1607.
  static auto* const set = kernel_function<SetDescription>("SetThreadDescription");
  if (set == nullptr) return;
  // A character that was cut becomes a replacement.
  std::array<wchar_t, thread_name.size()> shown{};
  MultiByteToWideChar(CP_UTF8, 0, thread_name.data(), static_cast<int>(size), shown.data(),
                      static_cast<int>(shown.size()) - 1);
  static_cast<void>(set(GetCurrentThread(), shown.data()));
}

void name_of_this_thread(std::array<char, 16>& name) noexcept {
  name = thread_name;
}

expected<void, SetupError> confine_this_thread(const std::string& subject,
                                               const std::vector<int>& cpus) {
  // The CPUs of the process's group, of which there are at most 64.
  constexpr int kGroupSizeMax = 8 * sizeof(DWORD_PTR);
  DWORD_PTR wanted = 0;
  bool is_possible = true;
  for (const int cpu : cpus) {
    is_possible &= cpu >= 0 && cpu < kGroupSizeMax;
    if (is_possible) wanted |= DWORD_PTR{1} << cpu;
  }
  // The system refuses CPUs that the machine does not have.
  const int error = !is_possible
                        ? ERROR_INVALID_PARAMETER
                        : error_unless(SetThreadAffinityMask(GetCurrentThread(), wanted) != 0);
  if (error == 0) return {};
  return setup_error(subject + " can't be confined to CPU " + list_of(cpus),
                     std::error_code(error, std::system_category()),
                     "name CPUs that this machine has and the process may use (see the Task "
                     "Manager: Details, Set affinity); those beyond 64 can't be named");
}

int request_level(int level) noexcept {
  if (!has_level) {
    static const bool is_refused = (refuse_throttling(), true);
    static_cast<void>(is_refused);
    has_level = true;
    DWORD task = 0;
    if (level >= kUrgentFrom) multimedia_class = AvSetMmThreadCharacteristicsW(L"Pro Audio", &task);
  }
  if (multimedia_class != nullptr)
    return error_unless(AvSetMmThreadPriority(multimedia_class, urgent_range_of(level).priority));
  return error_unless(SetThreadPriority(GetCurrentThread(), system_priority_of(level).value));
}

void leave_multimedia_class() noexcept {
  if (multimedia_class != nullptr) AvRevertMmThreadCharacteristics(multimedia_class);
  multimedia_class = nullptr;
}

std::string name_of_level(int level) {
  if (multimedia_class != nullptr)
    return std::string("MMCSS Pro Audio, ") + urgent_range_of(level).name;
  return system_priority_of(level).name;
}

std::string remedy_of_level(int level) {
  if (level < kUrgentFrom || multimedia_class != nullptr) return {};
  return "start the service 'Multimedia Class Scheduler' (as an administrator: sc start MMCSS), "
         "and "
         "give at most 32 threads of a program priorities from 16384 on";
}

SetupError level_refusal(const std::string& subject, int level, int error) {
  const std::error_code cause(error, std::system_category());
  return {subject + " can't run at " + name_of_level(level) + " (" + cause.message() + ")",
          "its latency is not bounded",
          "start the program outside of a job or sandbox that limits priorities, or say --realtime "
          "off.",
          cause};
}

bool yield_to_all() noexcept {
  return SetThreadPriority(GetCurrentThread(), THREAD_PRIORITY_IDLE) != 0;
}

}  // namespace rtpm::rt::os
