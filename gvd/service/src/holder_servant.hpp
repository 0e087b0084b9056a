#pragma once

#include <cstdint>
#include <holder.rtpm.hpp>
#include <string>

#include "rtpm/base/time.hpp"
#include "rtpm/gvd/command_lease.hpp"
#include "rtpm/rt/pi_mutex.hpp"

namespace rtpm::gvd {

/// The service rtpm.device.LeaseHolder over one device's lease.
/// @ownership refers to the lease
/// @threads  any lane
/// @realtime set-up only
class HolderServant final : public device::LeaseHolderServant {
 public:
  explicit HolderServant(const Lease& lease) noexcept : lease_(lease) {}

  rpc::Result<device::Outcome> introduce(const device::IntroduceRequest& request,
                                         const rpc::CallContext& context) override;
  rpc::Result<void> holder(rpc::ReplyBuilder<device::HolderReply>& reply,
                           const rpc::CallContext& context) override;

 private:
  struct Holder {
    std::uint64_t lease = Lease::kNobody;
    std::string name{};
    std::string key_name{};
    MonotonicTime since{};
  };

  const Lease& lease_;
  rt::PiMutex mutex_{};
  Holder holder_{};  ///< The last client that introduced itself. Guarded by `mutex_`.
};

}  // namespace rtpm::gvd
