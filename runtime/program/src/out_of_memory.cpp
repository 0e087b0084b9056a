#include <cxxabi.h>
#include <unistd.h>

#include <cerrno>
#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <new>
#include <typeinfo>

// Part of every program of RTPM, see rtpm_program() in cmake/RtpmTargets.cmake, and of no library:
// a program that embeds RTPM decides itself how to handle an exception.
namespace {

std::terminate_handler handler_before = nullptr;

bool has_memory() noexcept {
  constexpr std::size_t kLittle = 4096;
  void* const little = std::malloc(kLittle);
  std::free(little);
  return little != nullptr;
}

// Runs on the thread that threw the exception, and must not throw itself. There may be no memory
// for a stream.
[[noreturn]] void say_if_out_of_memory() noexcept {
  const std::type_info* const thrown = abi::__cxa_current_exception_type();
  // There may have been no memory for the exception itself.
  const bool is_out_of_memory =
      thrown == nullptr
          ? !has_memory()
          : *thrown == typeid(std::bad_alloc) || *thrown == typeid(std::bad_array_new_length);
  if (is_out_of_memory) {
    dprintf(STDERR_FILENO,
            "%s: out of memory: the system gave no more. Remedy: raise the limit of the process "
            "(ulimit -v; LimitAS= and MemoryMax= of a systemd unit), or configure less.\n",
            program_invocation_short_name);
    _exit(1);
  }
  if (handler_before != nullptr) handler_before();
  std::abort();
}

[[maybe_unused]] const bool is_handler_set = [] {
  handler_before = std::set_terminate(say_if_out_of_memory);
  return true;
}();

}  // namespace
