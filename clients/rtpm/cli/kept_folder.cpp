#include "cli/kept_folder.hpp"

#include <cstdlib>
#include <filesystem>
#include <system_error>

namespace rtpm::tool {

std::string kept_folder() {
  const auto path_in = [](const char* variable) {
    const char* const path = std::getenv(variable);
    return path != nullptr && *path == '/' ? std::string(path) : std::string();
  };
  const std::string state = path_in("XDG_STATE_HOME");
  const std::string home = path_in("HOME");
  if (state.empty() && home.empty()) return {};
  const std::string folder = (state.empty() ? home + "/.local/state" : state) + "/rtpm";
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  return error ? std::string() : folder;
}

}  // namespace rtpm::tool
