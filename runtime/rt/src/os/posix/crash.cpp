#include "rtpm/rt/crash.hpp"

#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <csignal>
#include <cstdint>
#include <cstring>
#include <string_view>

#include "os/crash_facts.hpp"

namespace rtpm::rt {
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

/// Code from `begin` to `end`; unused without a name.
struct NamedCode {
  std::atomic<bool> is_taken{false};
  std::atomic<const char*> name{nullptr};
  std::uintptr_t begin = 0;
  std::uintptr_t end = 0;
};
constinit std::array<NamedCode, 64> named_code{};

constinit thread_local const CrashNote* innermost_note = nullptr;
constinit const char* crash_program = "";
constinit const char* crash_remedy = "";

const char* name_of_code(std::uintptr_t address) noexcept {
  for (const NamedCode& code : named_code) {
    // SYNC POINT code-name: the range belongs to the name.
    const char* const name = code.name.load(std::memory_order_acquire);
    if (name != nullptr && address >= code.begin && address < code.end) return name;
  }
  return nullptr;
}

}  // namespace

/// Built without the heap, as signal handlers require.
struct CrashLine {
  void add(std::string_view text) noexcept {
    const std::size_t taken = std::min(text.size(), bytes.size() - 1 - size);
    std::memcpy(bytes.data() + size, text.data(), taken);
    size += taken;
  }
  void add_number(int number) noexcept {
    std::array<char, 12> digits{};
    std::size_t at = digits.size();
    do {
      digits[--at] = static_cast<char>('0' + number % 10);
      number /= 10;
    } while (number > 0);
    add({digits.data() + at, digits.size() - at});
  }
  void add_notes() noexcept {
    for (const CrashNote* note = innermost_note; note != nullptr; note = note->outer_) {
      add(", in ");
      add(note->text_);
    }
  }
  void write() noexcept {
    bytes[size] = '\n';
    static_cast<void>(!::write(STDERR_FILENO, bytes.data(), size + 1));
  }

  std::array<char, 1024> bytes{};
  std::size_t size = 0;
};

namespace {

extern "C" void report_crash(int signal, siginfo_t*, void* context) {
  std::array<char, 16> thread{};
  os::name_of_this_thread(thread);
  CrashLine line;
  line.add(crash_program);
  line.add(": signal ");
  line.add_number(signal);
  for (const Fatal& fatal : kFatal) {
    if (fatal.signal != signal) continue;
    line.add(" (");
    line.add(fatal.name);
    line.add(")");
  }
  line.add(" ends the process");
  if (thread[0] != '\0') {
    line.add(": thread ");
    line.add(thread.data());
  }
  line.add_notes();
  if (const char* const code = name_of_code(os::program_counter(context)); code != nullptr) {
    line.add(", code of ");
    line.add(code);
  }
  line.add(".");
  if (*crash_remedy != '\0') {
    line.add(" Remedy: ");
    line.add(crash_remedy);
    line.add(".");
  }
  line.write();
  // SA_RESETHAND has removed the handler.
  ::raise(signal);
}

}  // namespace

CrashNote::CrashNote(const char* text) noexcept : outer_(innermost_note), text_(text) {
  innermost_note = this;
}

CrashNote::~CrashNote() {
  innermost_note = outer_;
}

CodeName::CodeName(const void* begin, std::size_t size, const char* name) noexcept
    : slot_(named_code.size()) {
  for (std::size_t i = 0; i < named_code.size(); ++i) {
    NamedCode& code = named_code[i];
    if (code.is_taken.exchange(true, std::memory_order_acq_rel)) continue;
    code.begin = reinterpret_cast<std::uintptr_t>(begin);
    code.end = code.begin + size;
    // SYNC POINT code-name
    code.name.store(name, std::memory_order_release);
    slot_ = i;
    return;
  }
}

CodeName::~CodeName() {
  if (slot_ == named_code.size()) return;
  named_code[slot_].name.store(nullptr, std::memory_order_release);
  named_code[slot_].is_taken.store(false, std::memory_order_release);
}

void report_crashes(const char* program, const char* remedy) noexcept {
  crash_program = program;
  crash_remedy = remedy;
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

}  // namespace rtpm::rt
