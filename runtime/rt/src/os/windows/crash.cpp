#include <windows.h>

#include <array>
#include <csignal>
#include <cstdint>
#include <string_view>

#include "crash_line.hpp"
#include "module.hpp"
#include "os/crash_facts.hpp"

namespace rtpm::rt::os {
namespace {

struct Fatal {
  DWORD code;
  std::string_view name;
};
constexpr std::array kFatal{
    Fatal{EXCEPTION_ACCESS_VIOLATION, "access violation"},
    Fatal{EXCEPTION_IN_PAGE_ERROR, "a page can't be read"},
    Fatal{EXCEPTION_DATATYPE_MISALIGNMENT, "misaligned access"},
    Fatal{EXCEPTION_ILLEGAL_INSTRUCTION, "illegal instruction"},
    Fatal{EXCEPTION_PRIV_INSTRUCTION, "privileged instruction"},
    Fatal{EXCEPTION_INT_DIVIDE_BY_ZERO, "division by zero"},
    Fatal{EXCEPTION_FLT_DIVIDE_BY_ZERO, "division by zero"},
    Fatal{EXCEPTION_STACK_OVERFLOW, "stack overflow"},
};

// The filter of the program's runtime library, which runs afterwards.
constinit LPTOP_LEVEL_EXCEPTION_FILTER next_filter = nullptr;

LONG WINAPI report_exception(EXCEPTION_POINTERS* exception) noexcept {
  const EXCEPTION_RECORD& record = *exception->ExceptionRecord;
  for (const Fatal& fatal : kFatal) {
    if (fatal.code != record.ExceptionCode) continue;
    CrashLine cause;
    cause.add("exception 0x");
    cause.add_number(record.ExceptionCode, 16);
    cause.add(" (");
    cause.add(fatal.name);
    cause.add(")");
    write_crash({cause.bytes.data(), cause.size},
                reinterpret_cast<std::uintptr_t>(record.ExceptionAddress));
  }
  return next_filter != nullptr ? next_filter(exception) : EXCEPTION_CONTINUE_SEARCH;
}

// abort() ends the process when this returns.
extern "C" void report_abort(int) {
  write_crash("signal 22 (aborted)", 0);
}

}  // namespace

void write_error(std::string_view text) noexcept {
  DWORD written = 0;
  WriteFile(GetStdHandle(STD_ERROR_HANDLE), text.data(), static_cast<DWORD>(text.size()), &written,
            nullptr);
}

void catch_crashes() noexcept {
  static const bool is_caught = [] {
    keep_loaded(reinterpret_cast<const void*>(&report_exception));
    next_filter = SetUnhandledExceptionFilter(&report_exception);
    return true;
  }();
  static_cast<void>(is_caught);
  const auto present = std::signal(SIGABRT, &report_abort);
  if (present != SIG_DFL) std::signal(SIGABRT, present);
}

}  // namespace rtpm::rt::os
