#include <cstdlib>
#include <exception>

#include "os/process.hpp"

// Part of every program of RTPM, see rtpm_program() in cmake/RtpmTargets.cmake, and of no library:
// a program that embeds RTPM decides itself how to handle an exception.
namespace {

std::terminate_handler handler_before = nullptr;

// Runs on the thread that threw the exception, and must not throw itself. There may be no memory
// for a stream.
[[noreturn]] void say_if_out_of_memory() noexcept {
  namespace os = rtpm::program::os;
  if (os::is_out_of_memory()) {
    os::print_last_error("out of memory: the system gave no more. Remedy: ", os::memory_remedy());
    os::end_process(1);
  }
  if (handler_before != nullptr) handler_before();
  std::abort();
}

[[maybe_unused]] const bool is_handler_set = [] {
  handler_before = std::set_terminate(say_if_out_of_memory);
  return true;
}();

}  // namespace
