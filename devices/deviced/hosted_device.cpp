#include "hosted_device.hpp"

#include <algorithm>
#include <utility>

#include "drivers.hpp"
#include "isolated_driver.hpp"
#include "rtpm/configuration/client.hpp"
#include "rtpm/gvd/holder.hpp"
#include "rtpm/gvd/offer.hpp"

namespace rtpm::deviced {
namespace {

/// The name of a thread is limited to 15 bytes.
rt::ThreadConfig thread_of(const Configuration& configuration, const DeviceSettings& device,
                           const std::string& prefix) {
  return {.name = (prefix + device.name).substr(0, 15),
          .priority = device.priority,
          .cpus = device.cpus,
          .realtime = configuration.settings.server.realtime};
}

constexpr double kRateMinHz = 10;
constexpr double kRateMaxHz = 50000;

/// The rate of the device's cycle.
expected<double, SetupError> rate_hz_of(const DeviceSettings& device,
                                        const driver::Descriptor& descriptor) {
  const bool is_given = device.rate_hz > 0;
  const double rate_hz = is_given ? device.rate_hz : descriptor.rate_hz;
  if (rate_hz >= kRateMinHz && rate_hz <= kRateMaxHz) return rate_hz;
  const std::string key = "--device-" + device.name + "-rate";
  return setup_error((is_given ? key : "its driver's rate") + " is " + std::to_string(rate_hz) +
                         " Hz, and no device runs at that",
                     "", "set " + key + " to 10 to 50000 Hz");
}

gvd::SafetyConfig safety_of(const DeviceSettings& device, const driver::Descriptor& descriptor) {
  gvd::SafetyConfig safety = gvd::SafetyConfig::for_device(descriptor);
  const auto set = [](double& limit, double given) {
    if (given > 0) limit = given;
  };
  if (device.force_max_newton > 0) {
    safety.force_newton_max = std::min(safety.force_newton_max, device.force_max_newton);
  }
  safety.hold_max = device.hold_max;
  safety.ramp = device.ramp;
  safety.soft_start = device.soft_start;
  safety.watchdog = gvd::watchdog_policy_of(device.watchdog);
  set(safety.power_watt_max, device.power_max_watt);
  set(safety.velocity_m_per_s_max, device.velocity_max_m_per_s);
  set(safety.force_newton_continuous, device.force_continuous_newton);
  set(safety.passivity_watt, device.passivity_watt);
  return safety;
}

gvd::DeviceServerConfig config_of(const Configuration& configuration, const DeviceSettings& device,
                                  const driver::Descriptor& descriptor, double rate_hz) {
  gvd::DeviceServerConfig config;
  config.cycle.period =
      std::chrono::duration_cast<Duration>(std::chrono::duration<double>(1.0 / rate_hz));
  config.cycle.gone_after = device.gone_after;
  config.cycle.lease = configuration.lease;
  config.cycle.operator_priority = configuration.operator_priority;
  config.cycle.safety = safety_of(device, descriptor);
  config.starts_without_device = true;
  config.thread = thread_of(configuration, device, "dev-");
  return config;
}

}  // namespace

expected<std::unique_ptr<HostedDevice>, SetupError> HostedDevice::create(
    const Configuration& configuration, const DeviceSettings& device, DeviceEvents& events) {
  std::unique_ptr<HostedDevice> hosted(new HostedDevice(configuration.name_of(device), events));
  auto driver = hosted->make_driver(configuration, device);
  if (!driver) return setup_error(hosted->name_, std::move(driver.error()));
  const driver::Descriptor descriptor = (*driver)->describe();
  const auto rate_hz = rate_hz_of(device, descriptor);
  if (!rate_hz) return setup_error(hosted->name_, rate_hz.error());
  gvd::DeviceServerConfig config = config_of(configuration, device, descriptor, *rate_hz);
  config.cycle.listener = &hosted->reporter_;
  config.cycle.emergency_stops = &events;
  config.cycle.stop_memory = &events.stops().add(hosted->name_, descriptor);
  auto observer = events.observe(hosted->name_);
  if (!observer) return unexpected{observer.error()};
  config.cycle.observer = *observer;
  auto server = gvd::DeviceServer::create(std::move(*driver), std::move(config));
  if (!server) return setup_error(hosted->name_, std::move(server.error()));
  hosted->server_ = std::move(*server);
  hosted->rate_hz_ = *rate_hz;
  if (auto configured = hosted->configure(configuration); !configured) {
    return unexpected{configured.error()};
  }
  events.stops().attach(*hosted->server_);
  return hosted;
}

expected<std::unique_ptr<driver::Driver>, SetupError> HostedDevice::make_driver(
    const Configuration& configuration, const DeviceSettings& device) {
  if (!device.is_isolated) return deviced::make_driver(device, name_);
  const rt::ThreadConfig thread = thread_of(configuration, device, "drv-");
  return driver_host::isolate(
      {.command = isolated_command(device, name_, thread), .listener = &reporter_});
}

expected<void, SetupError> HostedDevice::configure(const Configuration& configuration) {
  auto manager = gvd::ConfigurationManager::create(
      server_->configurable(),
      {.settings_folder = configuration.settings_folder, .listener = &change_reporter_});
  if (!manager) return setup_error(name_, manager.error());
  manager_ = std::move(*manager);
  for (const std::string& ignored : manager_->ignored())
    reporter_.report(ignored);
  return {};
}

void HostedDevice::ChangeReporter::on_change(std::uint64_t revision,
                                             std::span<const std::string> names) {
  std::string text = "parameters have changed (revision " + std::to_string(revision) + "):";
  for (const std::string& name : names)
    text += " " + name;
  reporter_.report(text);
  events_.publish_configuration(name_, revision, names);
}

expected<void, SetupError> HostedDevice::add_to(rpc::Server& server,
                                                introspection::Catalog& catalog) {
  const auto add = [&](const std::string& path, rpc::Servant& servant) {
    auto added = server.add(path, servant);
    if (added) catalog.add(path, servant);
    return added;
  };
  if (auto added = add(name_, server_->servant()); !added) return added;
  if (auto added = add(gvd::holder_path(name_), server_->holder_servant()); !added) return added;
  return add(gvd::configuration_path(name_), manager_->servant());
}

expected<void, SetupError> HostedDevice::bind(rpc::Node& node, rpc::Server& server,
                                              const Configuration& configuration) {
  if (configuration.registry == kNoRegistry) return {};
  // Names below this one, such as that of its configuration, need no separate binding.
  auto bound = names::Registration::create(
      node, configuration.registry, name_, server.url(name_),
      std::string(server_->servant().interface().name), names::Registration::kDefaultLease, {},
      configuration.allows_takeover ? names::Takeover::kAllowed : names::Takeover::kRefused,
      gvd::properties_of(server_->descriptor(), rate_hz_));
  if (!bound) return unexpected{bound.error()};
  registration_ = std::move(*bound);
  return {};
}

}  // namespace rtpm::deviced
