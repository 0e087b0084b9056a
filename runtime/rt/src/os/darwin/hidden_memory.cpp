#include "os/hidden_memory.hpp"

#include <mach/vm_inherit.h>
#include <sys/mman.h>

// Not run yet: written from Apple's headers and manual pages.
namespace rtpm::rt::os {

bool hide(void* begin, std::size_t size) noexcept {
  return minherit(begin, size, VM_INHERIT_NONE) == 0;
}

}  // namespace rtpm::rt::os
