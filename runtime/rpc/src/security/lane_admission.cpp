#include "security/lane_admission.hpp"

#include "rtpm/rt/clock.hpp"

namespace rtpm::rpc {

bool LaneAdmission::admits(const crypto::PublicKey& client,
                           const wire::PeerAddress& peer) noexcept {
  return judge(origin_at(&client, peer));
}

bool LaneAdmission::admits_unsealed(const wire::PeerAddress& peer) noexcept {
  return judge(origin_at(nullptr, peer));
}

bool LaneAdmission::judge(const CallOrigin& origin) noexcept {
  if (control_.knows(origin)) return true;
  const MonotonicTime now = rt::now();
  if (const auto suppressed = refusals_.admit(now)) {
    AuditNote note(AuditNote::Kind::kSessionRefused, origin, now);
    note.suppressed_count = *suppressed;
    audit_.note(note);
  }
  return false;
}

Priority LaneAdmission::ceiling(sealed::ClientKey client, const wire::PeerAddress& peer) noexcept {
  return control_.ceiling(origin_at(client, peer));
}

bool LaneAdmission::keeps(sealed::ClientKey client, const wire::PeerAddress& peer,
                          std::uint32_t since) noexcept {
  return control_.keeps(origin_at(client, peer), since);
}

}  // namespace rtpm::rpc
