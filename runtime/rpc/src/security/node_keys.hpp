#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "rtpm/access/files.hpp"
#include "rtpm/access/known_servers.hpp"
#include "rtpm/access/log_file.hpp"
#include "rtpm/base/expected.hpp"
#include "rtpm/base/setup_error.hpp"
#include "rtpm/rpc/security.hpp"
#include "rtpm/rt/log.hpp"
#include "rtpm/rt/pi_mutex.hpp"
#include "rtpm/sealed/client.hpp"
#include "rtpm/transport/address.hpp"
#include "security/secret.hpp"

namespace rtpm::rpc {

/// A node's long-lived key.
using OwnKey = Secret<crypto::KeyPair>;

/// A node's key and the servers that it knows. A bind reads their files at first use, and again
/// when they have changed.
/// @threads  any
/// @realtime set-up only
class NodeKeys {
 public:
  explicit NodeKeys(const NodeSecurity& files) : files_(files) {}

  /// The keys that this server may have, by the host in its URL or by its address. If there are
  /// any, the node's own key is loaded, too. Empty if the server is not known.
  /// @errors   known_servers can't be trusted: then no other host may be called over a network ·
  ///           the server is known, but the node's own key is missing or can't be trusted · the key
  ///           log can't be opened
  [[nodiscard]] expected<std::vector<access::KnownServer>, SetupError> keys_of(
      const std::string& host, const transport::SocketAddress& server);
  /// The local users whose servers may share memory with this node, from known_servers.
  [[nodiscard]] std::vector<std::uint32_t> trusted_users();
  /// The node's own key, as the last bind read it.
  /// @errors   this process is a fork of the one that read it
  [[nodiscard]] expected<std::shared_ptr<const OwnKey>, SetupError> own();
  /// The line of known_servers with this key; line 0 if there is none.
  [[nodiscard]] access::KnownServer entry_of(const crypto::PublicKey& key);

  [[nodiscard]] bool has_log() const noexcept { return !files_.key_log_file.empty(); }
  /// Writes a session's keys to the key log.
  void log(std::uint64_t session, const crypto::SessionKeys& keys) noexcept;

  // The limits of later sessions; only tests change them.
  crypto::SessionLimits limits{};
  Duration renewal_interval = sealed::SealedClientConfig{}.renewal_interval;

 private:
  [[nodiscard]] expected<void, SetupError> read_known_servers();
  [[nodiscard]] expected<void, SetupError> read_own();
  [[nodiscard]] expected<void, SetupError> open_log();

  const NodeSecurity& files_;
  rt::PiMutex mutex_;
  rt::Log errors_{"rtpm"};
  access::FileStamp known_stamp_{};
  access::KnownServers known_{};
  access::FileStamp own_stamp_{};
  std::shared_ptr<const OwnKey> own_{};
  std::optional<access::LogFile> key_log_;
};

}  // namespace rtpm::rpc
