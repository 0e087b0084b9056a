#include "os/folder_path.hpp"

namespace rtpm::transport::os {

std::string short_path_of(int folder, const std::string&) {
  return "/proc/self/fd/" + std::to_string(folder);
}

}  // namespace rtpm::transport::os
