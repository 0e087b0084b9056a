#pragma once

#include <string>

#include "rtpm/base/expected.hpp"
#include "rtpm/base/setup_error.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/rpc/security.hpp"
#include "rtpm/transport/address.hpp"

// Decides which servers are reachable from other hosts, and which of these do not authenticate
// callers.
namespace rtpm::rpc {

/// Whether other hosts can reach the server.
[[nodiscard]] bool is_for_other_hosts(const transport::HostsToServe& hosts) noexcept;

/// The server's file of grants; empty if it does not authenticate callers.
/// @realtime set-up only
/// @errors   other hosts reach the server, but neither grants nor `is_insecure` are set
[[nodiscard]] expected<std::string, SetupError> grants_file_of(
    const ServerSecurity& security, const transport::HostsToServe& hosts);

/// Warns on standard error, now and once a minute, that a server accepts every caller.
/// @threads  one, not a lane's
class OpenWarning {
 public:
  static constexpr Duration kInterval = std::chrono::minutes{1};

  /// @param subject  "server 'rtpm-deviced'"
  /// @param where    "10.0.0.7:7500"
  OpenWarning(std::string subject, const std::string& where);
  /// Warns if due.
  /// @return when the next warning is due
  MonotonicTime tick(MonotonicTime now);

 private:
  std::string text_;
  MonotonicTime next_ = MonotonicTime::min();
};

}  // namespace rtpm::rpc
