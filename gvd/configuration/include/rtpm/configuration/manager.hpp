#pragma once

#include <memory>
#include <string>
#include <vector>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/configuration/configurable.hpp"
#include "rtpm/rpc/servant.hpp"
#include "rtpm/rt/thread.hpp"

namespace rtpm::gvd {

/// Configures a configuration manager.
struct ConfigurationManagerConfig {
  /// The folder where settings are saved. It and its parent, which must exist, must be writable. If
  /// empty, nothing is saved, and save() is refused.
  std::string settings_folder{};
  ParameterListener* listener = nullptr;  ///< May be null; must outlive the manager.
  rt::ThreadConfig thread{.name = "configuration", .realtime = rt::RealtimeMode::kOff};
};

/// Serves the parameters and calibrations of one device, on its own time-shared thread: the paper's
/// Configuration Manager. Calls wait for that thread, and the thread waits for the device and the
/// disk; the device waits for neither.
/// @ownership refers to its device, which must outlive it
/// @threads  create and destroy on one thread
class ConfigurationManager {
 public:
  /// Loads the saved settings and applies them to `device`, then starts. Create it before the
  /// device's thread starts, so that no cycle sees other values.
  /// @realtime set-up only
  /// @errors   an invalid parameter; a refused settings file, see SettingsStore::load(); the device
  ///           refuses its values
  [[nodiscard]] static expected<std::unique_ptr<ConfigurationManager>, SetupError> create(
      Configurable& device, const ConfigurationManagerConfig& config = {});
  ConfigurationManager(const ConfigurationManager&) = delete;
  ConfigurationManager& operator=(const ConfigurationManager&) = delete;
  /// Ends the thread after the current request. Stop the rpc::Server first.
  ~ConfigurationManager();

  /// The object for an rpc::Server, at the device's configuration_path(); lives as long as this.
  [[nodiscard]] rpc::Servant& servant() noexcept;
  /// A sentence for each parameter in the settings file that was ignored.
  [[nodiscard]] const std::vector<std::string>& ignored() const noexcept;

 private:
  struct Impl;
  explicit ConfigurationManager(std::unique_ptr<Impl> impl) noexcept;
  std::unique_ptr<Impl> impl_;
};

}  // namespace rtpm::gvd
