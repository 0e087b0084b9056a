#include "os/memory_lock.hpp"

namespace rtpm::rt::os {

expected<std::string, SetupError> lock_all_memory() {
  return unexpected{SetupError{
      "memory can't be locked (this system locks none as it is touched): page faults may delay "
      "real-time threads",
      {},
      "say --realtime off, or prefer."}};
}

}  // namespace rtpm::rt::os
