#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "rtpm/access/files.hpp"
#include "rtpm/access/fingerprint.hpp"
#include "rtpm/rpc/security.hpp"

namespace rtpm::rpc::test {

/// The keys of a server and a node of this host that know each other, and their other files.
class SealedFiles {
 public:
  SealedFiles()
      : folder_((std::filesystem::temp_directory_path() / "rtpm-sealed-XXXXXX").string()) {
    EXPECT_NE(mkdtemp(folder_.data()), nullptr);
    const std::string node = make("node");
    const std::string server = make("server");
    std::ofstream(file("authorized")) << node << " role=administer on=**\n";
    std::ofstream(file("known_servers")) << "127.0.0.1 " << server << "\n[::1] " << server << "\n";
  }
  SealedFiles(const SealedFiles&) = delete;
  SealedFiles& operator=(const SealedFiles&) = delete;
  ~SealedFiles() { std::filesystem::remove_all(folder_); }

  [[nodiscard]] ServerSecurity of_server() const {
    return {.authorized_file = file("authorized"), .key_file = file("server")};
  }
  [[nodiscard]] NodeSecurity of_node() const {
    return {.key_file = file("node"), .known_servers_file = file("known_servers")};
  }

 private:
  [[nodiscard]] std::string file(const std::string& name) const { return folder_ + "/" + name; }
  [[nodiscard]] std::string make(const std::string& name) const {
    const auto key = access::make_key(file(name), name);
    EXPECT_TRUE(key) << key.error().text();
    return key ? access::public_key_text(key->public_key) : "";
  }

  std::string folder_;
};

}  // namespace rtpm::rpc::test
