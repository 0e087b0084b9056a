#pragma once

#include <device.rtpm.hpp>

#include "cycle.hpp"
#include "rtpm/gvd/server.hpp"

namespace rtpm::gvd {

/// The service rtpm.device.Device over one device's cycle.
/// @ownership refers to the cycle and the descriptor, which must outlive it
/// @threads  any lane
/// @realtime like the cycle's methods; describe(), set_models() and read_flight_record() build
///           their replies in the lane's buffer and are set-up only
class DeviceServant final : public device::DeviceServant {
 public:
  /// @param view  may be null
  DeviceServant(DeviceCycle& cycle, const driver::Descriptor& descriptor, Duration period,
                ClientView* view) noexcept
      : cycle_(cycle), descriptor_(descriptor), period_(period), view_(view) {}

  rpc::Result<void> describe(rpc::ReplyBuilder<device::Description>& reply,
                             const rpc::CallContext& context) override;
  rpc::Result<device::Sample> read(const rpc::CallContext& context) override;
  rpc::Result<device::Outcome> command(const device::Command& request,
                                       const rpc::CallContext& context) override;
  rpc::Result<device::Lease> acquire(const rpc::CallContext& context) override;
  rpc::Result<device::Outcome> renew(const device::Holder& request,
                                     const rpc::CallContext& context) override;
  rpc::Result<device::Outcome> release(const device::Holder& request,
                                       const rpc::CallContext& context) override;
  rpc::Result<device::Outcome> recover(const device::Holder& request,
                                       const rpc::CallContext& context) override;
  rpc::Result<device::Outcome> activate(const device::Holder& request,
                                        const rpc::CallContext& context) override;
  rpc::Result<device::Outcome> deactivate(const device::Holder& request,
                                          const rpc::CallContext& context) override;
  rpc::Result<device::Lease> take_over(const rpc::CallContext& context) override;
  rpc::Result<device::LeaseStanding> lease_state(const device::Holder& request,
                                                 const rpc::CallContext& context) override;
  rpc::Result<device::Outcome> emergency_stop(const device::Stop& request,
                                              const rpc::CallContext& context) override;
  rpc::Result<device::Outcome> rearm(const device::Holder& request,
                                     const rpc::CallContext& context) override;

  rpc::Result<void> set_models(const device::SetModelsRequest& request,
                               rpc::ReplyBuilder<device::SetModelsReply>& reply,
                               const rpc::CallContext& context) override;
  rpc::Result<void> read_flight_record(const device::FlightRecordRequest& request,
                                       rpc::ReplyBuilder<device::FlightRecordReply>& reply,
                                       const rpc::CallContext& context) override;

 private:
  DeviceCycle& cycle_;
  const driver::Descriptor& descriptor_;
  Duration period_;
  ClientView* view_;
};

}  // namespace rtpm::gvd
