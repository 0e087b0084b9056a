#include "rtpm/rt/public_memory.hpp"

#include <sys/mman.h>

#include <cerrno>

#include "rtpm/rt/memory.hpp"

// No other process can find the memory here, which is therefore private.
namespace rtpm::rt {

expected<PublicMemory, SetupError> PublicMemory::create(std::string_view name, std::size_t size) {
  void* const begin =
      mmap(nullptr, size, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  if (begin == MAP_FAILED) {
    return setup_error("memory 'rtpm-" + std::string(name) + "' can't be made", system_error(errno),
                       "raise the limit of memory");
  }
  PublicMemory memory;
  memory.bytes_ = {static_cast<std::byte*>(begin), size};
  prefault(memory.bytes_);
  return memory;
}

bool PublicView::is_alive() const noexcept {
  return false;
}

std::vector<PublicView> find_public_memory(std::string_view, std::size_t) {
  return {};
}

}  // namespace rtpm::rt
