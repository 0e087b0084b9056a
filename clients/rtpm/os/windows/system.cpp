#include "os/system.hpp"

#include <windows.h>

#include <algorithm>
#include <chrono>

namespace rtpm::tool::os {
namespace {

int code_at_end = 0;

HANDLE handle_of(Stream stream) noexcept {
  switch (stream) {
    case Stream::kInput:
      return GetStdHandle(STD_INPUT_HANDLE);
    case Stream::kOutput:
      return GetStdHandle(STD_OUTPUT_HANDLE);
    case Stream::kError:
      break;
  }
  return GetStdHandle(STD_ERROR_HANDLE);
}

void CALLBACK end_now(PVOID, BOOLEAN) {
  ExitProcess(static_cast<UINT>(code_at_end));
}

}  // namespace

bool is_terminal(Stream stream) noexcept {
  DWORD mode = 0;
  if (GetConsoleMode(handle_of(stream), &mode) == 0) return false;
  return stream == Stream::kInput ||
         SetConsoleMode(handle_of(stream), mode | ENABLE_VIRTUAL_TERMINAL_PROCESSING) != 0;
}

void write_error(std::string_view text) noexcept {
  DWORD written = 0;
  WriteFile(GetStdHandle(STD_ERROR_HANDLE), text.data(), static_cast<DWORD>(text.size()), &written,
            nullptr);
}

SetupError become_python(std::vector<std::string>) {
  return {.what = "Parquet files are not written on Windows",
          .why = "RTPM starts Python's converter on Linux only",
          .remedy = "write tables by --csv, or export the recording on Linux"};
}

void end_after(Duration time, int exit_code) noexcept {
  code_at_end = exit_code;
  const auto wait = std::chrono::ceil<std::chrono::milliseconds>(std::max(time, Duration{1}));
  HANDLE timer = nullptr;
  CreateTimerQueueTimer(&timer, nullptr, &end_now, nullptr, static_cast<DWORD>(wait.count()), 0,
                        WT_EXECUTEINTIMERTHREAD);
}

}  // namespace rtpm::tool::os
