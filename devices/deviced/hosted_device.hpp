#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <utility>

#include "configuration.hpp"
#include "device_events.hpp"
#include "rtpm/base/setup_error.hpp"
#include "rtpm/configuration/manager.hpp"
#include "rtpm/driver_host/isolated.hpp"
#include "rtpm/gvd/server.hpp"
#include "rtpm/introspection/catalog.hpp"
#include "rtpm/names/registration.hpp"
#include "rtpm/rpc/node.hpp"
#include "rtpm/rpc/server.hpp"
#include "rtpm/rt/log.hpp"

namespace rtpm::deviced {

/// One device of this program: its driver, thread, configuration, objects and name.
/// @threads  set-up: one thread
/// @realtime set-up only
class HostedDevice {
 public:
  /// Creates the driver, the device's server and its configuration, and loads the saved settings.
  /// @errors   those of make_driver(), DeviceEvents::observe(), gvd::DeviceServer::create() and
  ///           gvd::ConfigurationManager::create()
  [[nodiscard]] static expected<std::unique_ptr<HostedDevice>, SetupError> create(
      const Configuration& configuration, const DeviceSettings& device, DeviceEvents& events);

  /// Adds the device's objects to `server`.
  /// @errors   those of rpc::Server::add()
  [[nodiscard]] expected<void, SetupError> add_to(rpc::Server& server,
                                                  introspection::Catalog& catalog);
  /// Starts the device's thread.
  /// @errors   those of gvd::DeviceServer::start()
  [[nodiscard]] expected<void, SetupError> start() { return server_->start(); }
  /// Binds the device's name at the registry if one is configured.
  /// @errors   those of names::Registration::create()
  [[nodiscard]] expected<void, SetupError> bind(rpc::Node& node, rpc::Server& server,
                                                const Configuration& configuration);
  /// Removes the name so that no client finds a server that is about to stop.
  void unbind() noexcept { registration_.reset(); }
  /// Stops the device's server, like gvd::DeviceServer::request_stop() and stop().
  void request_stop() noexcept { server_->request_stop(); }
  [[nodiscard]] bool stop(Duration patience) noexcept { return server_->stop(patience); }
  /// Whether the driver has returned from its set-up, successfully or not.
  [[nodiscard]] bool has_sample() const noexcept { return server_->newest().has_value(); }

  [[nodiscard]] const gvd::DeviceServer& server() const noexcept { return *server_; }
  [[nodiscard]] const std::string& name() const noexcept { return name_; }

 private:
  /// Logs the device's events to standard error.
  class Reporter final : public gvd::DeviceListener, public driver_host::IsolationListener {
   public:
    explicit Reporter(std::string name) : name_(std::move(name)) {}
    void report(std::string_view text) override { log_.write(name_ + ": " + std::string(text)); }

   private:
    std::string name_;
    rt::Log log_{"rtpm-deviced"};
  };

  /// Logs changes of parameters and pushes them as events.
  class ChangeReporter final : public gvd::ParameterListener {
   public:
    ChangeReporter(Reporter& reporter, DeviceEvents& events, const std::string& name)
        : reporter_(reporter), events_(events), name_(name) {}
    void on_change(std::uint64_t revision, std::span<const std::string> names) override;

   private:
    Reporter& reporter_;
    DeviceEvents& events_;
    const std::string& name_;
  };

  HostedDevice(std::string name, DeviceEvents& events)
      : name_(std::move(name)), reporter_(name_), change_reporter_(reporter_, events, name_) {}
  [[nodiscard]] expected<std::unique_ptr<driver::Driver>, SetupError> make_driver(
      const Configuration& configuration, const DeviceSettings& device);
  [[nodiscard]] expected<void, SetupError> configure(const Configuration& configuration);

  std::string name_;
  double rate_hz_ = 0;  ///< The rate of the cycle.
  Reporter reporter_;
  ChangeReporter change_reporter_;
  std::unique_ptr<gvd::DeviceServer> server_{};
  std::unique_ptr<gvd::ConfigurationManager> manager_{};
  std::unique_ptr<names::Registration> registration_{};
};

}  // namespace rtpm::deviced
