#pragma once

#include "rtpm/sealed/server.hpp"
#include "security/access_control.hpp"
#include "security/audit_log.hpp"
#include "security/handshake_rate.hpp"

namespace rtpm::rpc {

/// Decides by the grants which clients a lane admits.
/// @threads  one at a time, with the lane's Lead
/// @realtime alloc-free; a look-up takes a lock with priority inheritance
class LaneAdmission final : public sealed::Admission {
 public:
  LaneAdmission(const AccessControl& control, AuditLog& audit, HandshakeRate& rate) noexcept
      : control_(control), audit_(audit), rate_(rate) {}

  /// Whether a grant applies to the client. Notes a refusal.
  [[nodiscard]] bool admits(const crypto::PublicKey& client,
                            const wire::PeerAddress& peer) noexcept override;
  [[nodiscard]] bool admits_unsealed(const wire::PeerAddress& peer) noexcept override;
  [[nodiscard]] Priority ceiling(sealed::ClientKey client,
                                 const wire::PeerAddress& peer) noexcept override;
  [[nodiscard]] bool admits_handshake(MonotonicTime now) noexcept override {
    return rate_.admit(now);
  }
  [[nodiscard]] std::uint32_t generation() noexcept override { return control_.generation(); }
  [[nodiscard]] bool keeps(sealed::ClientKey client, const wire::PeerAddress& peer,
                           std::uint32_t since) noexcept override;

 private:
  [[nodiscard]] bool judge(const CallOrigin& origin) noexcept;

  const AccessControl& control_;
  AuditLog& audit_;
  HandshakeRate& rate_;
  NoteLimit refusals_{8, std::chrono::seconds{1}};
};

}  // namespace rtpm::rpc
