#pragma once

#include <string>

#include "rtpm/access/files.hpp"
#include "rtpm/access/fingerprint.hpp"
#include "rtpm/rpc/security.hpp"
#include "rtpm/test/key_folder.hpp"

namespace rtpm::rpc::test {

/// The keys of a server and a node of this host that know each other, and their other files.
class SealedFiles {
 public:
  SealedFiles() {
    const std::string node = make("node");
    const std::string server = make("server");
    folder_.write("authorized", node + " role=administer on=**\n");
    folder_.write("known_servers", "127.0.0.1 " + server + "\n[::1] " + server + "\n");
  }

  [[nodiscard]] ServerSecurity of_server() const {
    return {.authorized_file = folder_.file("authorized"), .key_file = folder_.file("server")};
  }
  [[nodiscard]] NodeSecurity of_node() const {
    return {.key_file = folder_.file("node"), .known_servers_file = folder_.file("known_servers")};
  }

 private:
  [[nodiscard]] std::string make(const std::string& name) const {
    const auto key = access::make_key(folder_.file(name), name);
    EXPECT_TRUE(key) << key.error().text();
    return key ? access::public_key_text(key->public_key) : "";
  }

  KeyFolder folder_;
};

}  // namespace rtpm::rpc::test
