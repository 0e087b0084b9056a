#include "configurator.hpp"

#include <algorithm>
#include <mutex>
#include <utility>

#include "rtpm/base/printable.hpp"

namespace rtpm::gvd {
namespace {

using driver::ParameterSetting;

unexpected<ConfigurationError> refused(ConfigurationOutcome outcome, std::string what,
                                       std::string why, std::string remedy) {
  return {{outcome, {}, {std::move(what), std::move(why), std::move(remedy)}}};
}

}  // namespace

Configurator::Configurator(Configurable& device, ParameterTable table,
                           std::optional<SettingsStore> store, ParameterListener* listener)
    : device_(device),
      table_(std::move(table)),
      store_(std::move(store)),
      listener_(listener),
      calibrations_(device.calibrations()) {}

ConfigurationSnapshot Configurator::snapshot() const {
  const std::lock_guard lock(mutex_);
  return {table_.revision(), store_.has_value(), is_unsaved_, table_.values()};
}

std::uint64_t Configurator::revision() const {
  const std::lock_guard lock(mutex_);
  return table_.revision();
}

expected<RevisedSettings, ConfigurationError> Configurator::settings(
    std::span<const std::string> names) const {
  const std::lock_guard lock(mutex_);
  auto settings = table_.settings(names);
  if (!settings) return unexpected{std::move(settings.error())};
  return RevisedSettings{table_.revision(), std::move(*settings)};
}

expected<std::vector<std::string>, SetupError> Configurator::load() {
  if (!store_) return std::vector<std::string>{};
  auto stored = store_->load(table_.specs());
  if (!stored) return unexpected{std::move(stored.error())};
  std::erase_if(stored->settings, [&](const ParameterSetting& setting) {
    if (table_.check({&setting, 1}, false)) return false;
    stored->ignored.push_back("'" + store_->path() + "': " + setting.name +
                              " can't be changed any more; the default is used");
    return true;
  });
  if (auto applied = apply(table_.revision(), std::move(stored->settings)); !applied) {
    return setup_error("the settings of '" + store_->path() + "' can't be applied",
                       std::move(applied.error().words));
  }
  const std::lock_guard lock(mutex_);
  is_unsaved_ = false;
  return std::move(stored->ignored);
}

expected<RevisedSettings, ConfigurationError> Configurator::apply(
    std::uint64_t revision, std::vector<ParameterSetting> settings) {
  // Only this thread changes the table, so it reads without the lock.
  if (auto current = table_.check_revision(revision); !current) {
    return unexpected{std::move(current.error())};
  }
  if (auto checked = table_.check(settings, device_.is_active()); !checked) {
    return unexpected{std::move(checked.error())};
  }
  if (!settings.empty()) {
    if (auto applied = device_.apply(settings, table_.needs_inactive(settings)); !applied) {
      return unexpected{std::move(applied.error())};
    }
  }
  std::vector<std::string> changed;
  {
    const std::lock_guard lock(mutex_);
    changed = table_.commit(settings);
    is_unsaved_ = is_unsaved_ || !changed.empty();
  }
  if (!changed.empty() && listener_ != nullptr) listener_->on_change(table_.revision(), changed);
  return RevisedSettings{table_.revision(), std::move(settings)};
}

expected<RevisedSettings, ConfigurationError> Configurator::reset(
    std::uint64_t revision, std::span<const std::string> names) {
  auto defaults = table_.reset(names);
  if (!defaults) return unexpected{std::move(defaults.error())};
  return apply(revision, std::move(*defaults));
}

expected<void, ConfigurationError> Configurator::save() {
  if (!store_) {
    return refused(ConfigurationOutcome::kNotPersistent, "the parameters were not saved",
                   "the device's server has no folder for settings",
                   "start it with one (rtpm-deviced --settings FOLDER)");
  }
  if (auto saved = store_->save(table_.changed_settings()); !saved) {
    return unexpected{
        ConfigurationError{ConfigurationOutcome::kStorageFailed, {}, std::move(saved.error())}};
  }
  const std::lock_guard lock(mutex_);
  is_unsaved_ = false;
  return {};
}

std::uint64_t Configurator::open_run() const noexcept {
  return run_ && run_->is_open() ? run_->status().run : 0;
}

expected<CalibrationStatus, ConfigurationError> Configurator::calibrate(const std::string& name,
                                                                        MonotonicTime now) {
  const bool is_known =
      std::ranges::find(calibrations_, name, &driver::CalibrationInfo::name) != calibrations_.end();
  if (!is_known) {
    return refused(ConfigurationOutcome::kUnknownCalibration,
                   "the device has no calibration " + printable(name),
                   calibrations_.empty() ? "it has none at all" : "", "list its calibrations");
  }
  if (run_ && run_->is_open()) {
    return refused(ConfigurationOutcome::kBusy, "the calibration did not start",
                   "the calibration " + run_->status().name + " (run " +
                       std::to_string(run_->status().run) + ") is not over",
                   "finish or discard it");
  }
  auto made = device_.make_calibration(name);
  if (!made) return unexpected{std::move(made.error())};
  run_.emplace(std::move(*made), name, ++run_count_, table_.revision(), now);
  run_->step(device_.newest(), now);
  return run_->status();
}

expected<CalibrationRun*, ConfigurationError> Configurator::find_run(std::uint64_t run,
                                                                     MonotonicTime now) {
  if (!run_ || run_->status().run != run) {
    return refused(ConfigurationOutcome::kNoSuchRun, "the calibration is not there any more",
                   "it has ended, and another began, or the device's server was started again",
                   "calibrate again");
  }
  // Called before the client's query is registered: a late query must not revive a run.
  run_->step(device_.newest(), now);
  run_->note_question(now);
  return &*run_;
}

expected<CalibrationStatus, ConfigurationError> Configurator::calibration(std::uint64_t run,
                                                                          MonotonicTime now) {
  const auto found = find_run(run, now);
  if (!found) return unexpected{found.error()};
  return (*found)->status();
}

expected<CalibrationStatus, ConfigurationError> Configurator::answer(std::uint64_t run,
                                                                     std::uint32_t prompt,
                                                                     std::string_view text,
                                                                     MonotonicTime now) {
  const auto found = find_run(run, now);
  if (!found) return unexpected{found.error()};
  if (auto taken = (*found)->answer(prompt, text); !taken) {
    return unexpected{std::move(taken.error())};
  }
  return (*found)->status();
}

expected<CalibrationStatus, ConfigurationError> Configurator::keep(std::uint64_t run,
                                                                   MonotonicTime now) {
  const auto found = find_run(run, now);
  if (!found) return unexpected{found.error()};
  const CalibrationStatus& status = (*found)->status();
  if (status.phase != CalibrationPhase::kDone) {
    return refused(ConfigurationOutcome::kNoResult, "there is no result to keep",
                   "the calibration is " + std::string(to_string(status.phase)),
                   is_open(status.phase) ? "wait for its result" : "calibrate again");
  }
  auto applied = apply((*found)->revision(), status.settings);
  if (!applied) {
    if (applied.error().outcome == ConfigurationOutcome::kStaleRevision) {
      applied.error().words = {"the result was not kept",
                               "parameters have changed since the calibration began",
                               "calibrate again"};
    }
    return unexpected{std::move(applied.error())};
  }
  (*found)->keep(std::move(applied->settings));
  return (*found)->status();
}

expected<CalibrationStatus, ConfigurationError> Configurator::discard(std::uint64_t run,
                                                                      MonotonicTime now) {
  const auto found = find_run(run, now);
  if (!found) return unexpected{found.error()};
  if ((*found)->is_open()) (*found)->discard("a client discarded it");
  return (*found)->status();
}

void Configurator::step(MonotonicTime now) {
  if (run_) run_->step(device_.newest(), now);
}

}  // namespace rtpm::gvd
