#pragma once

#include <cstddef>

/// The line printed at a crash: the thread, and notes on its current work.
namespace rtpm::rt {

/// Records the calling thread's current work while it lives. Notes nest.
/// @ownership refers to `text`
/// @realtime alloc-free, no system call
class CrashNote {
 public:
  explicit CrashNote(const char* text) noexcept;
  CrashNote(const CrashNote&) = delete;
  CrashNote& operator=(const CrashNote&) = delete;
  ~CrashNote();

 private:
  friend struct CrashLine;
  const CrashNote* outer_;
  const char* text_;
};

/// Names loaded code, such as a plug-in's, so that a crash in it can be reported on any thread.
/// @ownership refers to `name`
/// @threads  any
/// @realtime alloc-free; at most 64 names at a time; further ones are ignored
class CodeName {
 public:
  CodeName(const void* begin, std::size_t size, const char* name) noexcept;
  CodeName(const CodeName&) = delete;
  CodeName& operator=(const CodeName&) = delete;
  ~CodeName();

 private:
  std::size_t slot_;
};

/// Makes SIGSEGV, SIGBUS, SIGILL, SIGFPE and SIGABRT print one line before they end the process as
/// usual: the program, the thread, its notes and the named code. A signal that already has a
/// handler, such as a sanitizer's, keeps it. On Windows: unhandled exceptions, and SIGABRT.
/// @param program, remedy  texts with static lifetime; an empty remedy is left out
/// @realtime set-up only
void report_crashes(const char* program, const char* remedy) noexcept;

}  // namespace rtpm::rt
