#include <sys/utsname.h>

#include "rtpm/rt/host.hpp"

namespace rtpm::rt {

std::string host_name() {
  utsname names{};
  return ::uname(&names) == 0 ? names.nodename : "";
}

std::string kernel_version() {
  utsname names{};
  return ::uname(&names) == 0 ? names.release : "";
}

}  // namespace rtpm::rt
