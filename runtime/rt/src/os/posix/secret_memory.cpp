#include "rtpm/rt/secret_memory.hpp"

#include <sys/mman.h>

#include <cerrno>
#include <cstring>
#include <string>
#include <utility>

#include "os/hidden_memory.hpp"
#include "rtpm/rt/memory.hpp"
#include "rtpm/rt/report.hpp"

namespace rtpm::rt {
namespace {

void note_lock(int error) {
  constexpr const char* kSubject = "memory of keys";
  if (error == 0) {
    note_setup({kSubject, Grant::kGranted, "it is locked, and is never swapped out", ""});
  } else {
    note_setup({kSubject, Grant::kRefused,
                "it can't be locked (" + std::string(std::strerror(error)) +
                    "): keys of sessions may be swapped out",
                "raise RLIMIT_MEMLOCK (ulimit -l, or LimitMEMLOCK= in a systemd unit), or encrypt "
                "the host's swap"});
  }
}

}  // namespace

SecretMemory::SecretMemory(std::size_t size) {
  if (size == 0) return;
  void* const begin =
      mmap(nullptr, size, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  if (begin == MAP_FAILED) return;
  if (!os::hide(begin, size)) {
    munmap(begin, size);
    return;
  }
  bytes_ = {static_cast<std::byte*>(begin), size};
  note_lock(mlock(begin, size) == 0 ? 0 : errno);
  prefault(bytes_);
}

SecretMemory::SecretMemory(SecretMemory&& other) noexcept
    : bytes_(std::exchange(other.bytes_, {})) {}

SecretMemory& SecretMemory::operator=(SecretMemory&& other) noexcept {
  std::swap(bytes_, other.bytes_);
  return *this;
}

SecretMemory::~SecretMemory() {
  if (bytes_.empty()) return;
  // A compiler may leave out other writes before the end.
  for (volatile std::byte* byte = bytes_.data(); byte != bytes_.data() + bytes_.size(); ++byte)
    *byte = std::byte{0};
  munmap(bytes_.data(), bytes_.size());
}

}  // namespace rtpm::rt
