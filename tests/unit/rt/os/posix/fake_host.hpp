#pragma once

#include <filesystem>
#include <fstream>
#include <string>

#include "rtpm/test/temporary_folder.hpp"

namespace rtpm::rt {

/// A folder with the files of a fake /proc and /sys.
class FakeHost {
 public:
  void put(const std::string& path, const std::string& text) const {
    std::filesystem::create_directories(std::filesystem::path(root() + path).parent_path());
    std::ofstream(root() + path) << text << '\n';
  }
  void link(const std::string& path, const std::string& target) const {
    std::filesystem::create_directories(std::filesystem::path(root() + path).parent_path());
    std::filesystem::create_symlink(target, root() + path);
  }
  [[nodiscard]] const std::string& root() const noexcept { return folder_.path(); }

 private:
  test::TemporaryFolder folder_;
};

}  // namespace rtpm::rt
