#include "rtpm/configuration/client.hpp"

#include <algorithm>
#include <utility>

#include "rtpm/configuration/list_reply.hpp"
#include "wire.hpp"

namespace rtpm::gvd {
namespace {

ConfigurationError failed(rpc::CallError error) {
  return {ConfigurationOutcome::kCallFailed,
          {},
          {"the device's configuration gave no answer",
           std::string(to_string(error)),
           {},
           make_error_code(error)}};
}

/// The reply as an object, if the call succeeded and its answer is "done".
template <class Object, class Reply>
expected<Object, ConfigurationError> object_of(const Reply& reply) {
  if (!reply) return unexpected{failed(reply.error())};
  Object object;
  (*reply)->UnPackTo(&object);
  if (object.answer->outcome != configuration::OutcomeCode::Done) {
    return unexpected{from_wire(*object.answer)};
  }
  return object;
}

template <class Reply>
expected<RevisedSettings, ConfigurationError> settings_of(const Reply& reply) {
  auto object = object_of<configuration::SettingsReplyT>(reply);
  if (!object) return unexpected{std::move(object.error())};
  return RevisedSettings{object->revision, from_wire(object->settings)};
}

template <class Reply>
expected<CalibrationStatus, ConfigurationError> status_of(const Reply& reply) {
  auto object = object_of<configuration::CalibrationReplyT>(reply);
  if (!object) return unexpected{std::move(object.error())};
  return from_wire(*object);
}

configuration::RunRequestT run_request(std::uint64_t run) {
  configuration::RunRequestT request;
  request.run = run;
  return request;
}

DeviceConfiguration configuration_of(const configuration::ListReply& reply) {
  configuration::ListReplyT list;
  reply.UnPackTo(&list);
  DeviceConfiguration configuration{.model = list.model,
                                    .serial = list.serial,
                                    .revision = list.revision,
                                    .is_active = list.is_active,
                                    .is_persistent = list.is_persistent,
                                    .is_unsaved = list.is_unsaved};
  for (const auto& parameter : list.parameters) {
    configuration.parameters.push_back({spec_from_wire(*parameter), from_wire(*parameter->value)});
  }
  return configuration;
}

}  // namespace

std::optional<DeviceConfiguration> configuration_in(ConstBytes list_reply) {
  // FlatBuffers must be read from aligned memory.
  const std::vector<std::byte> bytes(list_reply.begin(), list_reply.end());
  if (!rpc::is_valid_table<configuration::ListReply>(bytes)) return std::nullopt;
  return configuration_of(*flatbuffers::GetRoot<configuration::ListReply>(bytes.data()));
}

const Parameter* DeviceConfiguration::find(std::string_view name) const noexcept {
  const auto found = std::ranges::find(parameters, name, [](const Parameter& parameter) {
    return std::string_view(parameter.spec.name);
  });
  return found == parameters.end() ? nullptr : &*found;
}

struct ConfigurationClient::Impl {
  configuration::ConfigurationClient stub;
  rpc::CallOptions options{};
};

expected<ConfigurationClient, SetupError> ConfigurationClient::open(
    rpc::Node& node, std::string_view device, const ConfigurationClientOptions& options) {
  auto stub =
      configuration::ConfigurationClient::bind(node, configuration_path(device), options.bind);
  if (!stub) return unexpected{std::move(stub.error())};
  return ConfigurationClient(std::unique_ptr<Impl>(new Impl{std::move(*stub), options.call}));
}

ConfigurationClient::ConfigurationClient(std::unique_ptr<Impl> impl) noexcept
    : impl_(std::move(impl)) {}
ConfigurationClient::ConfigurationClient(ConfigurationClient&&) noexcept = default;
ConfigurationClient& ConfigurationClient::operator=(ConfigurationClient&&) noexcept = default;
ConfigurationClient::~ConfigurationClient() = default;

expected<DeviceConfiguration, ConfigurationError> ConfigurationClient::list() {
  const auto reply = impl_->stub.list({}, impl_->options);
  if (!reply) return unexpected{failed(reply.error())};
  return configuration_of(**reply);
}

expected<RevisedSettings, ConfigurationError> ConfigurationClient::get(
    const std::vector<std::string>& names) {
  configuration::GetRequestT request;
  request.names = names;
  return settings_of(impl_->stub.get(request, impl_->options));
}

expected<RevisedSettings, ConfigurationError> ConfigurationClient::apply(
    std::uint64_t revision, const std::vector<driver::ParameterSetting>& settings) {
  configuration::ApplyRequestT request;
  request.revision = revision;
  request.settings = to_wire(settings);
  return settings_of(impl_->stub.apply(request, impl_->options));
}

expected<RevisedSettings, ConfigurationError> ConfigurationClient::reset(
    std::uint64_t revision, const std::vector<std::string>& names) {
  configuration::ResetRequestT request;
  request.revision = revision;
  request.names = names;
  return settings_of(impl_->stub.reset(request, impl_->options));
}

expected<void, ConfigurationError> ConfigurationClient::save() {
  const auto saved = object_of<configuration::AnswerReplyT>(impl_->stub.save({}, impl_->options));
  if (!saved) return unexpected{saved.error()};
  return {};
}

expected<DeviceCalibrations, ConfigurationError> ConfigurationClient::calibrations() {
  const auto reply = impl_->stub.calibrations({}, impl_->options);
  if (!reply) return unexpected{failed(reply.error())};
  configuration::CalibrationsReplyT object;
  (*reply)->UnPackTo(&object);
  DeviceCalibrations calibrations{.open_run = object.run};
  for (const auto& info : object.calibrations) {
    calibrations.calibrations.push_back({info->name, info->description});
  }
  return calibrations;
}

expected<CalibrationStatus, ConfigurationError> ConfigurationClient::calibrate(
    std::string_view name) {
  configuration::CalibrateRequestT request;
  request.name = name;
  return status_of(impl_->stub.calibrate(request, impl_->options));
}

expected<CalibrationStatus, ConfigurationError> ConfigurationClient::calibration(
    std::uint64_t run) {
  return status_of(impl_->stub.calibration(run_request(run), impl_->options));
}

expected<CalibrationStatus, ConfigurationError> ConfigurationClient::answer(
    const CalibrationStatus& status, std::string_view text) {
  configuration::PromptAnswerT request;
  request.run = status.run;
  request.prompt = status.prompt;
  request.text = text;
  return status_of(impl_->stub.answer(request, impl_->options));
}

expected<CalibrationStatus, ConfigurationError> ConfigurationClient::keep(std::uint64_t run) {
  return status_of(impl_->stub.keep(run_request(run), impl_->options));
}

expected<CalibrationStatus, ConfigurationError> ConfigurationClient::discard(std::uint64_t run) {
  return status_of(impl_->stub.discard(run_request(run), impl_->options));
}

}  // namespace rtpm::gvd
