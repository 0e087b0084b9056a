#pragma once

#include <unistd.h>

#include <array>
#include <string>

namespace rtpm::console {

/// The name of this host.
[[nodiscard]] inline std::string host_name() {
  std::array<char, 256> name{};
  if (::gethostname(name.data(), name.size() - 1) != 0) return "unknown";
  return name.data();
}

}  // namespace rtpm::console
