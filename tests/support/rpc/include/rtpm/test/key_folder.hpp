#pragma once

#include <gtest/gtest.h>
#include <stdlib.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

namespace rtpm::rpc::test {

/// A folder that is removed with the test, and files in it that only this user can write.
class KeyFolder {
 public:
  KeyFolder() : path_((std::filesystem::temp_directory_path() / "rtpm-access-XXXXXX").string()) {
    EXPECT_NE(mkdtemp(path_.data()), nullptr);
  }
  KeyFolder(const KeyFolder&) = delete;
  KeyFolder& operator=(const KeyFolder&) = delete;
  ~KeyFolder() { std::filesystem::remove_all(path_); }

  [[nodiscard]] std::string file(const std::string& name) const { return path_ + "/" + name; }
  /// Replaces the former file as a whole.
  std::string write(const std::string& name, const std::string& text) const {
    const std::string whole = file(name);
    std::ofstream(whole + ".new") << text;
    std::filesystem::rename(whole + ".new", whole);
    return whole;
  }
  [[nodiscard]] std::string read(const std::string& name) const {
    std::ifstream stream(file(name));
    return {std::istreambuf_iterator<char>(stream), {}};
  }

 private:
  std::string path_;
};

}  // namespace rtpm::rpc::test
