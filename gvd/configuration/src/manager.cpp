#include "rtpm/configuration/manager.hpp"

#include <atomic>
#include <chrono>
#include <optional>
#include <random>
#include <utility>

#include "configurator.hpp"
#include "job_queue.hpp"
#include "rtpm/rt/clock.hpp"
#include "servant.hpp"

namespace rtpm::gvd {
namespace {

/// Interval between two samples for a calibration.
constexpr Duration kCalibrationPeriod = std::chrono::milliseconds{5};

/// Differs at each start, so that a revision from before a restart is stale.
std::uint64_t first_revision() {
  std::random_device random;
  return std::uint64_t{random()} << 32 | 1;
}

}  // namespace

struct ConfigurationManager::Impl {
  Impl(Configurable& device, ParameterTable table, std::optional<SettingsStore> store,
       ParameterListener* listener)
      : configurator(device, std::move(table), std::move(store), listener) {}
  ~Impl() {
    is_stopping.store(true, std::memory_order_relaxed);
    queue.ring();
    thread.join();
  }

  void run() {
    while (!is_stopping.load(std::memory_order_relaxed)) {
      const bool is_calibrating = configurator.open_run() != 0;
      const auto jobs = queue.wait_until(is_calibrating ? rt::now() + kCalibrationPeriod : kNever);
      for (const auto& job : jobs) {
        job->run(configurator, rt::now());
      }
      configurator.step(rt::now());
    }
  }

  Configurator configurator;
  JobQueue queue{};
  ConfigurationServant servant{configurator, queue};
  std::vector<std::string> ignored{};
  std::atomic<bool> is_stopping{false};
  rt::Thread thread{};
};

expected<std::unique_ptr<ConfigurationManager>, SetupError> ConfigurationManager::create(
    Configurable& device, const ConfigurationManagerConfig& config) {
  auto table = ParameterTable::create(device.parameters(), first_revision());
  if (!table) return unexpected{std::move(table.error())};
  std::optional<SettingsStore> store;
  if (!config.settings_folder.empty()) {
    store.emplace(config.settings_folder, device.descriptor().model, device.descriptor().serial);
  }
  auto impl = std::make_unique<Impl>(device, std::move(*table), std::move(store), config.listener);
  auto ignored = impl->configurator.load();
  if (!ignored) return unexpected{std::move(ignored.error())};
  impl->ignored = std::move(*ignored);
  auto thread = rt::Thread::start(config.thread, [&running = *impl] { running.run(); });
  if (!thread) return unexpected{std::move(thread.error())};
  impl->thread = std::move(*thread);
  return std::unique_ptr<ConfigurationManager>(new ConfigurationManager(std::move(impl)));
}

ConfigurationManager::ConfigurationManager(std::unique_ptr<Impl> impl) noexcept
    : impl_(std::move(impl)) {}
ConfigurationManager::~ConfigurationManager() = default;
rpc::Servant& ConfigurationManager::servant() noexcept {
  return impl_->servant;
}
const std::vector<std::string>& ConfigurationManager::ignored() const noexcept {
  return impl_->ignored;
}

}  // namespace rtpm::gvd
