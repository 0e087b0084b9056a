#include "shared_memory/futex.hpp"

#include <linux/futex.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <ctime>

#include "rtpm/rt/budget.hpp"
#include "rtpm/rt/native_time.hpp"

namespace rtpm::transport {

void sleep_on_word(std::atomic<std::uint32_t>& word, std::uint32_t value,
                   MonotonicTime until) noexcept {
  const rt::AsleepScope asleep;
  const timespec time = rt::to_timespec(until);
  // Of the waits this is the one that takes an absolute time.
  syscall(SYS_futex, &word, FUTEX_WAIT_BITSET, value, until == kNever ? nullptr : &time, nullptr,
          FUTEX_BITSET_MATCH_ANY);
}

void wake_on_word(std::atomic<std::uint32_t>& word) noexcept {
  syscall(SYS_futex, &word, FUTEX_WAKE, 1, nullptr, nullptr, 0);
}

}  // namespace rtpm::transport
