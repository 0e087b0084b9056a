#include "os/crash_facts.hpp"

#include <sys/prctl.h>
#include <ucontext.h>

namespace rtpm::rt::os {

void name_of_this_thread(std::array<char, 16>& name) noexcept {
  ::prctl(PR_GET_NAME, name.data());
}

std::uintptr_t program_counter(const void* context) noexcept {
  [[maybe_unused]] const auto& registers = static_cast<const ucontext_t*>(context)->uc_mcontext;
#if defined(__x86_64__)
  return static_cast<std::uintptr_t>(registers.gregs[REG_RIP]);
#elif defined(__aarch64__)
  return static_cast<std::uintptr_t>(registers.pc);
#else
  return 0;
#endif
}

}  // namespace rtpm::rt::os
