#include "os/native_clock.hpp"

#include <windows.h>

#include <algorithm>

#include "module.hpp"
#include "rtpm/base/assert.hpp"
#include "thread_timer.hpp"

#ifndef CREATE_WAITABLE_TIMER_HIGH_RESOLUTION  // Windows 10, version 1803.
#define CREATE_WAITABLE_TIMER_HIGH_RESOLUTION 0x00000002
#endif

namespace rtpm::rt::os {
namespace {

constexpr std::int64_t kNsPerSecond = 1'000'000'000;
constexpr std::int64_t kNsPerUnit = 100;  // The system's unit of times.

void WINAPI close_timer(void* timer) {
  if (timer != nullptr) CloseHandle(timer);
}

// A slot for each thread's timer, whose function runs when the thread ends. A thread_local's
// destructor would run too late under MinGW.
DWORD timer_slot() noexcept {
  static const DWORD slot = [] {
    keep_loaded(reinterpret_cast<const void*>(&close_timer));
    return FlsAlloc(&close_timer);
  }();
  RTPM_ASSERT(slot != FLS_OUT_OF_INDEXES, "the system has a slot for each thread's timer");
  return slot;
}

HANDLE fine_timer() noexcept {
  return CreateWaitableTimerExW(nullptr, nullptr, CREATE_WAITABLE_TIMER_HIGH_RESOLUTION,
                                TIMER_ALL_ACCESS);
}

HANDLE new_timer() noexcept {
  HANDLE timer = fine_timer();
  if (timer == nullptr) timer = CreateWaitableTimerExW(nullptr, nullptr, 0, TIMER_ALL_ACCESS);
  RTPM_ASSERT(timer != nullptr, "each thread gets a timer");
  return timer;
}

std::int64_t ticks_per_second() noexcept {
  static const std::int64_t frequency = [] {
    LARGE_INTEGER value{};
    QueryPerformanceFrequency(&value);
    return std::max<std::int64_t>(value.QuadPart, 1);
  }();
  return frequency;
}

}  // namespace

std::int64_t time_ns() noexcept {
  LARGE_INTEGER count{};
  QueryPerformanceCounter(&count);
  const std::int64_t frequency = ticks_per_second();
  // As a whole, the product would overflow after some minutes.
  return count.QuadPart / frequency * kNsPerSecond +
         count.QuadPart % frequency * kNsPerSecond / frequency;
}

HANDLE timer_at(MonotonicTime time) noexcept {
  const DWORD slot = timer_slot();
  HANDLE timer = FlsGetValue(slot);
  if (timer == nullptr) {
    timer = new_timer();
    FlsSetValue(slot, timer);
  }
  // A time of the past or now is due at once; a negative number means from now.
  const std::int64_t now = time_ns();
  const std::int64_t left = to_ns(time) > now ? to_ns(time) - now : 0;
  LARGE_INTEGER due{};
  due.QuadPart = -(left / kNsPerUnit + (left % kNsPerUnit == 0 ? 0 : 1));
  SetWaitableTimer(timer, &due, 0, nullptr, nullptr, FALSE);
  return timer;
}

bool has_fine_timers() noexcept {
  const HANDLE timer = fine_timer();
  if (timer != nullptr) CloseHandle(timer);
  return timer != nullptr;
}

// The system's waits may end early.
void sleep_until(MonotonicTime time) noexcept {
  while (time_ns() < to_ns(time))
    WaitForSingleObject(timer_at(time), INFINITE);
}

Duration thread_run_time() noexcept {
  FILETIME begin{};
  FILETIME end{};
  FILETIME kernel{};
  FILETIME user{};
  GetThreadTimes(GetCurrentThread(), &begin, &end, &kernel, &user);
  const auto units_of = [](const FILETIME& time) {
    return std::int64_t{time.dwHighDateTime} << 32 | std::int64_t{time.dwLowDateTime};
  };
  return Duration{(units_of(kernel) + units_of(user)) * kNsPerUnit};
}

}  // namespace rtpm::rt::os
