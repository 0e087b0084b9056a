#include "laboratory/program_path.hpp"

#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <sstream>
#include <system_error>

namespace rtpm::laboratory {
namespace {

namespace fs = std::filesystem;

bool is_executable(const fs::path& file) {
  std::error_code error;
  return fs::is_regular_file(file, error) && ::access(file.c_str(), X_OK) == 0;
}

}  // namespace

ProgramFolders ProgramFolders::of_this_process() {
  ProgramFolders folders;
  std::error_code error;
  folders.own = fs::read_symlink("/proc/self/exe", error).parent_path();
  const char* const path = std::getenv("PATH");
  std::istringstream list(path == nullptr ? "/usr/local/bin:/usr/bin:/bin" : path);
  for (std::string folder; std::getline(list, folder, ':');)
    folders.path.push_back(folder.empty() ? "." : folder);
  return folders;
}

expected<std::string, std::string> ProgramFolders::find(const std::string& name,
                                                        const std::string& folder) const {
  if (name.find('/') != std::string::npos) {
    const fs::path file = (fs::path(folder) / name).lexically_normal();
    if (is_executable(file)) return file.string();
    return unexpected{"there is no executable file " + file.string()};
  }
  if (is_executable(fs::path(own) / name)) return (fs::path(own) / name).string();
  for (const std::string& place : path) {
    std::error_code error;
    const fs::path file = fs::absolute(place, error) / name;
    if (is_executable(file)) return file.string();
  }
  std::string looked = "it is not in " + own + " (beside rtpm), nor in PATH:";
  for (const std::string& place : path)
    looked += " " + place;
  return unexpected{looked};
}

std::string shipped_file(const ProgramFolders& folders, const std::string& name) {
  // bin/ and share/ lie side by side, installed and in the build folder.
  const fs::path file = (fs::path(folders.own) / ".." / "share" / "rtpm" / name).lexically_normal();
  std::error_code error;
  return fs::is_regular_file(file, error) ? file.string() : std::string();
}

}  // namespace rtpm::laboratory
