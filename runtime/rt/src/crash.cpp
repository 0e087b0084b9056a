#include "rtpm/rt/crash.hpp"

#include <array>
#include <atomic>
#include <cstdint>

#include "crash_line.hpp"
#include "os/crash_facts.hpp"

namespace rtpm::rt {
namespace {

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

void CrashLine::add_notes() noexcept {
  for (const CrashNote* note = innermost_note; note != nullptr; note = note->outer_) {
    add(", in ");
    add(note->text_);
  }
}

void write_crash(std::string_view cause, std::uintptr_t program_counter) noexcept {
  std::array<char, 16> thread{};
  os::name_of_this_thread(thread);
  CrashLine line;
  line.add(crash_program);
  line.add(": ");
  line.add(cause);
  line.add(" ends the process");
  if (thread[0] != '\0') {
    line.add(": thread ");
    line.add(thread.data());
  }
  line.add_notes();
  if (const char* const code = name_of_code(program_counter); code != nullptr) {
    line.add(", code of ");
    line.add(code);
  }
  line.add(".");
  if (*crash_remedy != '\0') {
    line.add(" Remedy: ");
    line.add(crash_remedy);
    line.add(".");
  }
  line.bytes[line.size] = '\n';
  os::write_error({line.bytes.data(), line.size + 1});
}

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
  os::catch_crashes();
}

}  // namespace rtpm::rt
