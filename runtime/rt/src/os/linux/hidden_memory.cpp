#include "os/hidden_memory.hpp"

#include <sys/mman.h>

namespace rtpm::rt::os {

bool hide(void* begin, std::size_t size) noexcept {
  return madvise(begin, size, MADV_WIPEONFORK) == 0 && madvise(begin, size, MADV_DONTDUMP) == 0;
}

}  // namespace rtpm::rt::os
