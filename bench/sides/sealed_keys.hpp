#pragma once

#include <memory>
#include <string>
#include <utility>

#include "outcome.hpp"
#include "rtpm/rpc/security.hpp"

namespace rtpm::bench {

/// The keys of a server and its callers, in a folder that is removed with this object: the server
/// admits the callers for everything, and they know the server. A forked process never destroys it.
/// @threads  any
class SealedKeys {
 public:
  /// @param host  the server's address, numeric
  /// @realtime set-up only
  [[nodiscard]] static Outcome<std::shared_ptr<const SealedKeys>> make(const std::string& host);
  SealedKeys(const SealedKeys&) = delete;
  SealedKeys& operator=(const SealedKeys&) = delete;
  ~SealedKeys();

  [[nodiscard]] rpc::ServerSecurity server() const {
    return {.authorized_file = file("authorized"), .key_file = file("server")};
  }
  [[nodiscard]] rpc::NodeSecurity node() const {
    return {.key_file = file("client"), .known_servers_file = file("known_servers")};
  }

 private:
  explicit SealedKeys(std::string folder) : folder_(std::move(folder)) {}
  [[nodiscard]] std::string file(const std::string& name) const { return folder_ + "/" + name; }

  std::string folder_;
};

}  // namespace rtpm::bench
