#include "os/stop.hpp"

#include <windows.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <string>
#include <string_view>

namespace rtpm::program::os {
namespace {

HANDLE handle(StopSource source) noexcept {
  return reinterpret_cast<HANDLE>(source);
}

/// For the console's handler; a handle of the process's event that stays open.
std::atomic<HANDLE> handlers_event{nullptr};

/// An event that any process of this user can set to end this one in order. It stays set.
HANDLE open_event() {
  const std::wstring name = L"Local\\rtpm-stop-" + std::to_wstring(GetCurrentProcessId());
  return CreateEventW(nullptr, TRUE, FALSE, name.c_str());
}

/// Runs on a thread of the system's own, for Ctrl-C, Ctrl-Break, a closed console and a shutdown.
BOOL WINAPI on_console_event(DWORD kind) {
  SetEvent(handlers_event);
  // The system ends the process when the handler returns from these, and after some seconds anyway.
  if (kind != CTRL_C_EVENT && kind != CTRL_BREAK_EVENT) Sleep(INFINITE);
  return TRUE;
}

}  // namespace

std::vector<int> stop_signals() {
  return {SIGINT, SIGTERM};
}

StopSource open_stop_source() {
  const HANDLE event = open_event();
  if (event == nullptr) {
    constexpr std::string_view kText = "the system gives no event to wait for: close programs\n";
    DWORD written = 0;
    WriteFile(GetStdHandle(STD_ERROR_HANDLE), kText.data(), DWORD{kText.size()}, &written, nullptr);
    std::exit(1);
  }
  if (HANDLE none = nullptr; handlers_event.load() == nullptr) {
    const HANDLE own = open_event();
    if (handlers_event.compare_exchange_strong(none, own)) {
      SetConsoleCtrlHandler(on_console_event, TRUE);
    } else {
      CloseHandle(own);
    }
  }
  return reinterpret_cast<StopSource>(event);
}

void close_stop_source(StopSource source) noexcept {
  CloseHandle(handle(source));
}

bool await_stop(StopSource source, std::optional<Duration> patience) noexcept {
  DWORD timeout = INFINITE;
  if (patience) {
    constexpr std::chrono::milliseconds kLongest{std::chrono::hours{24}};
    const auto rounded = std::chrono::ceil<std::chrono::milliseconds>(*patience);
    timeout = static_cast<DWORD>(std::min(rounded, kLongest).count());
  }
  return WaitForSingleObject(handle(source), timeout) == WAIT_OBJECT_0;
}

}  // namespace rtpm::program::os
