#include "shared_memory/memory.hpp"

#include <fcntl.h>
#include <linux/futex.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <ctime>

#include "rtpm/rt/native_time.hpp"
#include "rtpm/transport/mapping.hpp"

namespace rtpm::transport {

Descriptor make_memory(const char* name, std::size_t size) noexcept {
  Descriptor memory(memfd_create(name, MFD_CLOEXEC | MFD_ALLOW_SEALING));
  if (!memory.is_open() || ftruncate(memory.number(), static_cast<off_t>(size)) == 0) return memory;
  return {};
}

bool seal_memory(int memory, int more_seals) noexcept {
  return fcntl(memory, F_ADD_SEALS, F_SEAL_SHRINK | F_SEAL_GROW | F_SEAL_SEAL | more_seals) == 0;
}

std::size_t sealed_size(int memory) noexcept {
  struct stat status {};
  const int seals = fcntl(memory, F_GET_SEALS);
  if (seals < 0 || (seals & F_SEAL_SHRINK) == 0 || fstat(memory, &status) != 0) return 0;
  return static_cast<std::size_t>(status.st_size);
}

void sleep_on_word(std::atomic<std::uint32_t>& word, std::uint32_t value, MonotonicTime until,
                   std::uint32_t bits) noexcept {
  const timespec time = rt::to_timespec(until);
  // The only futex wait with an absolute time.
  syscall(SYS_futex, &word, FUTEX_WAIT_BITSET, value, until == kNever ? nullptr : &time, nullptr,
          bits);
}

void wake_on_word(std::atomic<std::uint32_t>& word, int count_max, std::uint32_t bits) noexcept {
  syscall(SYS_futex, &word, FUTEX_WAKE_BITSET, count_max, nullptr, nullptr, bits);
}

SharedMapping::SharedMapping(int memory, std::size_t size, Access access) noexcept {
  const int protection = access == Access::kRead ? PROT_READ : PROT_READ | PROT_WRITE;
  void* const begin = mmap(nullptr, size, protection, MAP_SHARED, memory, 0);
  if (begin == MAP_FAILED) return;
  bytes_ = {static_cast<std::byte*>(begin), size};
  // MAP_POPULATE has no effect if memory is locked on fault (rt::lock_memory).
  constexpr std::size_t kPageSize = 4096;
  for (std::size_t at = 0; at < size; at += kPageSize) {
    static_cast<void>(*static_cast<const volatile std::byte*>(bytes_.data() + at));
  }
}

SharedMapping::~SharedMapping() {
  if (!bytes_.empty()) munmap(bytes_.data(), bytes_.size());
}

}  // namespace rtpm::transport
