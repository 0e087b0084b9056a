#pragma once

#include <device.rtpm.hpp>

#include "cycle.hpp"

namespace rtpm::gvd {

/// The service rtpm.device.Device over one device's cycle.
/// @ownership refers to the cycle and the descriptor, which must outlive it
/// @threads  any lane
/// @realtime as each method of the cycle; describe() builds its reply in the lane's buffer and is
///           set-up only
class DeviceServant final : public device::DeviceServant {
 public:
  DeviceServant(DeviceCycle& cycle, const driver::Descriptor& descriptor, Duration period) noexcept
      : cycle_(cycle), descriptor_(descriptor), period_(period) {}

  rpc::Result<void> describe(rpc::ReplyBuilder<device::Description>& reply,
                             const rpc::CallContext& context) override;
  rpc::Result<device::Sample> read(const rpc::CallContext& context) override;
  rpc::Result<void> command(const device::Command& request,
                            const rpc::CallContext& context) override;
  rpc::Result<device::Lease> acquire(const rpc::CallContext& context) override;
  rpc::Result<void> renew(const device::Holder& request, const rpc::CallContext& context) override;
  rpc::Result<void> release(const device::Holder& request,
                            const rpc::CallContext& context) override;
  rpc::Result<void> recover(const device::Holder& request,
                            const rpc::CallContext& context) override;
  rpc::Result<void> activate(const device::Holder& request,
                             const rpc::CallContext& context) override;
  rpc::Result<void> deactivate(const device::Holder& request,
                               const rpc::CallContext& context) override;
  rpc::Result<device::Lease> take_over(const rpc::CallContext& context) override;
  rpc::Result<device::LeaseStanding> lease_state(const device::Holder& request,
                                                 const rpc::CallContext& context) override;

 private:
  DeviceCycle& cycle_;
  const driver::Descriptor& descriptor_;
  Duration period_;
};

}  // namespace rtpm::gvd
