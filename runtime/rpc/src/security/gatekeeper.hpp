#pragma once

#include <atomic>
#include <memory>
#include <optional>
#include <vector>

#include "rtpm/access/log_file.hpp"
#include "rtpm/rt/log.hpp"
#include "rtpm/rt/thread.hpp"
#include "rtpm/transport/polled_wait_set.hpp"
#include "security/access_control.hpp"
#include "security/audit_log.hpp"
#include "security/gatekeeper_link.hpp"
#include "security/handshake_rate.hpp"
#include "security/secret.hpp"

namespace rtpm::rpc {

/// Reads a server's key, or makes it at the first start.
/// @param file   empty: the one in access::key_folder()
/// @realtime set-up only
/// @errors   as access::read_key() and make_key(); no memory
[[nodiscard]] expected<Secret<sealed::ServerIdentity>, SetupError> open_identity(
    const std::string& file);

/// A secured server's work that no lane waits for, on one time-shared thread: public keys of
/// handshakes, changed grants, logs. The lanes do what follows from it.
class Gatekeeper {
 public:
  /// How often it looks whether the grants changed, and writes the logs.
  static constexpr Duration kLookInterval = std::chrono::milliseconds{500};

  /// @param key_log_file  empty: none
  /// @param control, audit  outlive it
  /// @realtime set-up only
  /// @errors   the key log can't be opened; the system gives no descriptor
  [[nodiscard]] static expected<std::unique_ptr<Gatekeeper>, SetupError> open(
      const std::string& key_log_file, AccessControl& control, AuditLog& audit);

  /// The bell that lanes ring when they have work for it.
  [[nodiscard]] transport::WaitSet& bell() noexcept { return *wait_set_; }
  /// How many handshakes all lanes may begin.
  [[nodiscard]] HandshakeRate& rate() noexcept { return rate_; }

  /// @param lanes  the links of all lanes; they outlive stop()
  /// @param cpus   the CPUs to which it is confined; empty for the starter's
  [[nodiscard]] expected<void, SetupError> start(std::vector<GatekeeperLink*> lanes,
                                                 std::vector<int> cpus);
  /// Ends the thread. Handshakes that are under way come to nothing.
  void stop() noexcept;

 private:
  Gatekeeper(std::unique_ptr<transport::WaitSet> wait_set, AccessControl& control,
             AuditLog& audit) noexcept
      : wait_set_(std::move(wait_set)), control_(control), audit_(audit) {}
  void run();
  [[nodiscard]] bool work_once();
  void look();
  void write_key(const sealed::HandshakeJob& job);

  std::unique_ptr<transport::WaitSet> wait_set_;
  AccessControl& control_;
  AuditLog& audit_;
  HandshakeRate rate_;
  std::optional<access::LogFile> key_log_;
  rt::Log log_{"rtpm"};
  std::vector<GatekeeperLink*> lanes_;
  std::atomic<bool> is_stopping_{false};
  rt::Thread thread_;
};

}  // namespace rtpm::rpc
