#include <unistd.h>

#include <array>
#include <csignal>
#include <cstdint>
#include <string_view>

#include "crash_line.hpp"
#include "os/crash_facts.hpp"

namespace rtpm::rt::os {
namespace {

struct Fatal {
  int signal;
  std::string_view name;
};
constexpr std::array kFatal{
    Fatal{SIGSEGV, "segmentation fault"},
    Fatal{SIGBUS, "bus error"},
    Fatal{SIGILL, "illegal instruction"},
    Fatal{SIGFPE, "arithmetic error"},
    Fatal{SIGABRT, "aborted"},
};

extern "C" void report_crash(int signal, siginfo_t*, void* context) {
  CrashLine cause;
  cause.add("signal ");
  cause.add_number(static_cast<std::uint32_t>(signal));
  for (const Fatal& fatal : kFatal) {
    if (fatal.signal != signal) continue;
    cause.add(" (");
    cause.add(fatal.name);
    cause.add(")");
  }
  write_crash({cause.bytes.data(), cause.size}, program_counter(context));
  // SA_RESETHAND has removed the handler.
  ::raise(signal);
}

}  // namespace

void write_error(std::string_view text) noexcept {
  static_cast<void>(!::write(STDERR_FILENO, text.data(), text.size()));
}

void catch_crashes() noexcept {
  for (const Fatal& fatal : kFatal) {
    struct sigaction present {};
    ::sigaction(fatal.signal, nullptr, &present);
    if (present.sa_handler != SIG_DFL) continue;
    struct sigaction action {};
    action.sa_sigaction = &report_crash;
    action.sa_flags = static_cast<int>(SA_SIGINFO | SA_RESETHAND);
    ::sigaction(fatal.signal, &action, nullptr);
  }
}

}  // namespace rtpm::rt::os
