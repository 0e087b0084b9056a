#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <random>
#include <string>
#include <system_error>

namespace rtpm::test {

/// A folder that only this user can enter, removed with its content at the end.
class TemporaryFolder {
 public:
  TemporaryFolder() {
    std::random_device random;
    const std::string begin = (std::filesystem::temp_directory_path() / "rtpm-").string();
    do {
      path_ = begin + std::to_string(random());
    } while (!std::filesystem::create_directory(path_));
    std::filesystem::permissions(path_, std::filesystem::perms::owner_all);
  }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  ~TemporaryFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }

  [[nodiscard]] const std::string& path() const noexcept { return path_; }
  [[nodiscard]] std::string file(const std::string& name) const { return path_ + "/" + name; }
  /// Replaces the former file as a whole; returns its path.
  std::string write(const std::string& name, const std::string& text) const {
    const std::string whole = file(name);
    std::ofstream(whole + ".new", std::ios::binary) << text;
    std::filesystem::rename(whole + ".new", whole);
    return whole;
  }
  [[nodiscard]] std::string read(const std::string& name) const {
    std::ifstream stream(file(name));
    return {std::istreambuf_iterator<char>(stream), {}};
  }

 private:
  std::string path_{};
};

}  // namespace rtpm::test
