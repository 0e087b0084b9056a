#include "cli/kept_folder.hpp"

#include <filesystem>
#include <system_error>

#include "rtpm/program/state_folder.hpp"

namespace rtpm::tool {

std::string kept_folder() {
  const std::string folder = program::state_folder();
  if (folder.empty()) return {};
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  return error ? std::string() : folder;
}

}  // namespace rtpm::tool
