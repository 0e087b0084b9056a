#pragma once

#include <configuration.rtpm.hpp>

#include "configurator.hpp"
#include "job_queue.hpp"

namespace rtpm::gvd {

/// The service rtpm.configuration.Configuration. Reads run on the lane. All other calls wait for
/// device or disk, so they run on the manager's thread, which completes the deferred reply.
/// @ownership refers to configurator and queue, which must outlive it
/// @threads  any lane
/// @realtime set-up only
class ConfigurationServant final : public configuration::ConfigurationServant {
 public:
  ConfigurationServant(const Configurator& configurator, JobQueue& queue) noexcept
      : configurator_(configurator), queue_(queue) {}

  rpc::Result<void> list(rpc::ReplyBuilder<configuration::ListReply>& reply,
                         const rpc::CallContext& context) override;
  rpc::Result<void> get(const configuration::GetRequest& request,
                        rpc::ReplyBuilder<configuration::SettingsReply>& reply,
                        const rpc::CallContext& context) override;
  void apply(const configuration::ApplyRequest& request,
             rpc::DeferredTable<configuration::SettingsReply> reply,
             const rpc::CallContext& context) override;
  void save(rpc::DeferredTable<configuration::AnswerReply> reply,
            const rpc::CallContext& context) override;
  void reset(const configuration::ResetRequest& request,
             rpc::DeferredTable<configuration::SettingsReply> reply,
             const rpc::CallContext& context) override;
  void calibrations(rpc::DeferredTable<configuration::CalibrationsReply> reply,
                    const rpc::CallContext& context) override;
  void calibrate(const configuration::CalibrateRequest& request,
                 rpc::DeferredTable<configuration::CalibrationReply> reply,
                 const rpc::CallContext& context) override;
  void calibration(const configuration::RunRequest& request,
                   rpc::DeferredTable<configuration::CalibrationReply> reply,
                   const rpc::CallContext& context) override;
  void answer(const configuration::PromptAnswer& request,
              rpc::DeferredTable<configuration::CalibrationReply> reply,
              const rpc::CallContext& context) override;
  void keep(const configuration::RunRequest& request,
            rpc::DeferredTable<configuration::CalibrationReply> reply,
            const rpc::CallContext& context) override;
  void discard(const configuration::RunRequest& request,
               rpc::DeferredTable<configuration::CalibrationReply> reply,
               const rpc::CallContext& context) override;

 private:
  /// Lets the manager's thread complete `reply` with the result of `work`.
  template <class Table, class Work>
  void defer(rpc::DeferredTable<Table> reply, Work work);

  const Configurator& configurator_;
  JobQueue& queue_;
};

}  // namespace rtpm::gvd
