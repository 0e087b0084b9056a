#include "rtpm/rt/lazy_memory.hpp"

#include <sys/mman.h>

#include <utility>

namespace rtpm::rt {

LazyMemory::LazyMemory(std::size_t size) noexcept {
  if (size == 0) return;
  void* begin = mmap(nullptr, size, PROT_READ | PROT_WRITE,
                     MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
  if (begin != MAP_FAILED) bytes_ = {static_cast<std::byte*>(begin), size};
}

LazyMemory::LazyMemory(LazyMemory&& other) noexcept : bytes_(std::exchange(other.bytes_, {})) {}

LazyMemory& LazyMemory::operator=(LazyMemory&& other) noexcept {
  std::swap(bytes_, other.bytes_);
  return *this;
}

LazyMemory::~LazyMemory() {
  if (!bytes_.empty()) munmap(bytes_.data(), bytes_.size());
}

}  // namespace rtpm::rt
