#include "os/memory_lock.hpp"

#include <windows.h>

#include <algorithm>

#include "working_set.hpp"

namespace rtpm::rt::os {
namespace {

constexpr SIZE_T kMib = SIZE_T{1} << 20;

}  // namespace

// The system locks no memory as it is touched, but keeps a minimum of the process's pages resident.
expected<std::string, SetupError> lock_all_memory() {
  SIZE_T least = 0;
  SIZE_T most = 0;
  GetProcessWorkingSetSize(GetCurrentProcess(), &least, &most);
  DWORD error = ERROR_SUCCESS;
  for (SIZE_T kept = 256 * kMib; kept >= 4 * kMib; kept /= 2) {
    error = set_working_set(std::max(least, kept), std::max(most, 2 * kept),
                            QUOTA_LIMITS_HARDWS_MIN_ENABLE | QUOTA_LIMITS_HARDWS_MAX_DISABLE);
    if (error != ERROR_SUCCESS) continue;
    return "the system keeps up to " + std::to_string(kept / kMib) +
           " MiB of the touched memory resident";
  }
  const std::error_code cause(static_cast<int>(error), std::system_category());
  return unexpected{SetupError{
      "memory can't be locked (" + cause.message() + "): page faults may delay real-time threads",
      {},
      "give the user the right 'Increase a process working set' (secpol.msc: Local "
      "Policies, User Rights Assignment), or say --realtime off.",
      cause}};
}

}  // namespace rtpm::rt::os
