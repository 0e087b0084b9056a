#pragma once

#include <atomic>
#include <memory>
#include <optional>
#include <vector>

#include "rtpm/access/log_file.hpp"
#include "rtpm/rt/log.hpp"
#include "rtpm/rt/thread.hpp"
#include "rtpm/transport/wait_set.hpp"
#include "security/access_control.hpp"
#include "security/audit_log.hpp"
#include "security/gatekeeper_link.hpp"
#include "security/handshake_rate.hpp"
#include "security/secret.hpp"

namespace rtpm::rpc {

/// Reads a server's key, or creates it at the first start.
/// @param file   if empty, the one in access::key_folder()
/// @realtime set-up only
/// @errors   those of access::read_key() and make_key(); no memory
[[nodiscard]] expected<Secret<sealed::ServerIdentity>, SetupError> open_identity(
    const std::string& file);

/// A secured server's slow work, on one time-shared thread: public-key operations of handshakes,
/// changed grants, logs. The lanes apply the results.
class Gatekeeper {
 public:
  /// How often it checks the grants for changes, and writes the logs.
  static constexpr Duration kLookInterval = std::chrono::milliseconds{500};

  /// @param key_log_file  empty for none
  /// @param control, audit  must outlive it
  /// @realtime set-up only
  /// @errors   the key log can't be opened; the system gives no descriptor
  [[nodiscard]] static expected<std::unique_ptr<Gatekeeper>, SetupError> open(
      const std::string& key_log_file, AccessControl& control, AuditLog& audit);

  /// The bell that lanes ring to give it work.
  [[nodiscard]] transport::WaitSet& bell() noexcept { return *wait_set_; }
  /// Limits the handshakes of all lanes together.
  [[nodiscard]] HandshakeRate& rate() noexcept { return rate_; }

  /// @param lanes  the links of all lanes; must outlive stop()
  /// @param cpus   the CPUs that the thread is confined to; if empty, those of the starting thread
  [[nodiscard]] expected<void, SetupError> start(std::vector<GatekeeperLink*> lanes,
                                                 std::vector<int> cpus);
  /// Ends the thread. Discards pending handshakes.
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
