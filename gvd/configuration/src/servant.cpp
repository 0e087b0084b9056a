#include "servant.hpp"

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "rtpm/rt/memory.hpp"
#include "wire.hpp"

namespace rtpm::gvd {
namespace {

using CalibrationResult = expected<CalibrationStatus, ConfigurationError>;
using SettingsResult = expected<RevisedSettings, ConfigurationError>;

std::vector<std::string> texts_of(
    const flatbuffers::Vector<flatbuffers::Offset<flatbuffers::String>>* wire) {
  std::vector<std::string> texts;
  if (wire == nullptr) return texts;
  for (const flatbuffers::String* text : *wire) {
    texts.push_back(text->str());
  }
  return texts;
}

configuration::SettingsReplyT reply_of(const SettingsResult& result, std::uint64_t revision) {
  configuration::SettingsReplyT reply;
  reply.answer = to_wire(result ? nullptr : &result.error());
  reply.revision = revision;
  if (result) reply.settings = to_wire(result->settings);
  return reply;
}

configuration::CalibrationReplyT reply_of(const CalibrationResult& result) {
  if (result) return to_wire(*result);
  configuration::CalibrationReplyT reply;
  reply.answer = to_wire(&result.error());
  return reply;
}

/// Completes a reply with the result of `work`.
template <class Table, class Work>
class DeferredJob final : public Job {
 public:
  DeferredJob(rpc::DeferredTable<Table> reply, Work work)
      : reply_(std::move(reply)), work_(std::move(work)) {}
  void run(Configurator& configurator, MonotonicTime now) override {
    // No change may happen after the caller has stopped waiting.
    if (!reply_.is_awaited() || now >= reply_.deadline()) return refuse();
    const auto object = work_(configurator, now);
    auto builder = reply_.builder();
    builder.finish(Table::Pack(builder.builder(), &object));
    reply_.complete(builder);
  }
  void refuse() override { reply_.fail(rpc::Refusal::kOverload); }

 private:
  rpc::DeferredTable<Table> reply_;
  Work work_;
};

}  // namespace

template <class Table, class Work>
void ConfigurationServant::defer(rpc::DeferredTable<Table> reply, Work work) {
  queue_.post(std::make_unique<DeferredJob<Table, Work>>(std::move(reply), std::move(work)));
}

rpc::Result<void> ConfigurationServant::list(rpc::ReplyBuilder<configuration::ListReply>& reply,
                                             const rpc::CallContext&) {
  const rt::AllowAllocationScope set_up;
  const ConfigurationSnapshot snapshot = configurator_.snapshot();
  configuration::ListReplyT list;
  list.model = configurator_.descriptor().model;
  list.serial = configurator_.descriptor().serial;
  list.revision = snapshot.revision;
  list.is_active = configurator_.is_active();
  list.is_persistent = snapshot.is_persistent;
  list.is_unsaved = snapshot.is_unsaved;
  for (std::size_t i = 0; i < snapshot.values.size(); ++i) {
    list.parameters.push_back(to_wire(configurator_.specs()[i], snapshot.values[i]));
  }
  reply.finish(configuration::ListReply::Pack(reply.builder(), &list));
  return {};
}

rpc::Result<void> ConfigurationServant::get(const configuration::GetRequest& request,
                                            rpc::ReplyBuilder<configuration::SettingsReply>& reply,
                                            const rpc::CallContext&) {
  const rt::AllowAllocationScope set_up;
  const SettingsResult settings = configurator_.settings(texts_of(request.names()));
  const auto object = reply_of(settings, settings ? settings->revision : configurator_.revision());
  reply.finish(configuration::SettingsReply::Pack(reply.builder(), &object));
  return {};
}

void ConfigurationServant::apply(const configuration::ApplyRequest& request,
                                 rpc::DeferredTable<configuration::SettingsReply> reply,
                                 const rpc::CallContext&) {
  const rt::AllowAllocationScope set_up;
  configuration::ApplyRequestT object;
  request.UnPackTo(&object);
  defer(std::move(reply), [revision = object.revision, settings = from_wire(object.settings)](
                              Configurator& configurator, MonotonicTime) mutable {
    const auto applied = configurator.apply(revision, std::move(settings));
    return reply_of(applied, configurator.revision());
  });
}

void ConfigurationServant::save(rpc::DeferredTable<configuration::AnswerReply> reply,
                                const rpc::CallContext&) {
  const rt::AllowAllocationScope set_up;
  defer(std::move(reply), [](Configurator& configurator, MonotonicTime) {
    const auto saved = configurator.save();
    configuration::AnswerReplyT object;
    object.answer = to_wire(saved ? nullptr : &saved.error());
    return object;
  });
}

void ConfigurationServant::reset(const configuration::ResetRequest& request,
                                 rpc::DeferredTable<configuration::SettingsReply> reply,
                                 const rpc::CallContext&) {
  const rt::AllowAllocationScope set_up;
  defer(std::move(reply), [revision = request.revision(), names = texts_of(request.names())](
                              Configurator& configurator, MonotonicTime) {
    const auto applied = configurator.reset(revision, names);
    return reply_of(applied, configurator.revision());
  });
}

void ConfigurationServant::calibrations(rpc::DeferredTable<configuration::CalibrationsReply> reply,
                                        const rpc::CallContext&) {
  const rt::AllowAllocationScope set_up;
  defer(std::move(reply), [](Configurator& configurator, MonotonicTime) {
    configuration::CalibrationsReplyT object;
    object.run = configurator.open_run();
    for (const driver::CalibrationInfo& info : configurator.calibrations()) {
      auto one = std::make_unique<configuration::CalibrationInfoT>();
      one->name = info.name;
      one->description = info.description;
      object.calibrations.push_back(std::move(one));
    }
    return object;
  });
}

void ConfigurationServant::calibrate(const configuration::CalibrateRequest& request,
                                     rpc::DeferredTable<configuration::CalibrationReply> reply,
                                     const rpc::CallContext&) {
  const rt::AllowAllocationScope set_up;
  defer(std::move(reply),
        [name = request.name()->str()](Configurator& configurator, MonotonicTime now) {
          return reply_of(configurator.calibrate(name, now));
        });
}

void ConfigurationServant::calibration(const configuration::RunRequest& request,
                                       rpc::DeferredTable<configuration::CalibrationReply> reply,
                                       const rpc::CallContext&) {
  const rt::AllowAllocationScope set_up;
  defer(std::move(reply), [run = request.run()](Configurator& configurator, MonotonicTime now) {
    return reply_of(configurator.calibration(run, now));
  });
}

void ConfigurationServant::answer(const configuration::PromptAnswer& request,
                                  rpc::DeferredTable<configuration::CalibrationReply> reply,
                                  const rpc::CallContext&) {
  const rt::AllowAllocationScope set_up;
  defer(std::move(reply),
        [run = request.run(), prompt = request.prompt(), text = request.text()->str()](
            Configurator& configurator, MonotonicTime now) {
          return reply_of(configurator.answer(run, prompt, text, now));
        });
}

void ConfigurationServant::keep(const configuration::RunRequest& request,
                                rpc::DeferredTable<configuration::CalibrationReply> reply,
                                const rpc::CallContext&) {
  const rt::AllowAllocationScope set_up;
  defer(std::move(reply), [run = request.run()](Configurator& configurator, MonotonicTime now) {
    return reply_of(configurator.keep(run, now));
  });
}

void ConfigurationServant::discard(const configuration::RunRequest& request,
                                   rpc::DeferredTable<configuration::CalibrationReply> reply,
                                   const rpc::CallContext&) {
  const rt::AllowAllocationScope set_up;
  defer(std::move(reply), [run = request.run()](Configurator& configurator, MonotonicTime now) {
    return reply_of(configurator.discard(run, now));
  });
}

}  // namespace rtpm::gvd
