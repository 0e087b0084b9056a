#include "rtpm/configuration/parameter_table.hpp"

#include <algorithm>
#include <set>
#include <utility>

#include "rtpm/base/printable.hpp"
#include "rtpm/configuration/value_text.hpp"

namespace rtpm::gvd {
namespace {

using driver::Mutability;
using driver::ParameterSetting;
using driver::ParameterSpec;
using driver::ParameterType;
using driver::ParameterValue;
using driver::ValueFault;

ConfigurationError error_of(ConfigurationOutcome outcome, const std::string& parameter,
                            std::string what, std::string why, std::string remedy) {
  return {outcome, parameter, {std::move(what), std::move(why), std::move(remedy)}};
}

/// "safety.force_newton_max = 12 newton".
std::string setting_text(const ParameterSpec& spec, const ParameterValue& value) {
  std::string text = spec.name + " = " + to_text(value);
  if (!spec.unit.empty() && spec.unit != "1") text += " " + spec.unit;
  return text;
}

/// Texts are shown in terminals and stored as JSON.
bool is_plain(const ParameterValue& value) {
  const auto* text = std::get_if<std::string>(&value);
  return text == nullptr || printable(*text, kShownWhole) == *text;
}

expected<void, ConfigurationError> check_value(const ParameterSpec& spec,
                                               const ParameterValue& value) {
  switch (check(spec, value)) {
    case ValueFault::kNone:
      break;
    case ValueFault::kWrongType:
      return unexpected{error_of(ConfigurationOutcome::kWrongType, spec.name,
                                 setting_text(spec, value) + " is of the wrong type", "",
                                 "give a value of type " + std::string(to_string(spec.type)))};
    case ValueFault::kOutOfRange: {
      const std::string range = range_text(spec);
      return unexpected{
          error_of(ConfigurationOutcome::kOutOfRange, spec.name,
                   setting_text(spec, value) + " is out of range", "",
                   range.empty() ? "give a shorter text, or a finite number" : "choose " + range)};
    }
  }
  if (is_plain(value)) return {};
  return unexpected{error_of(ConfigurationOutcome::kOutOfRange, spec.name,
                             spec.name + " is given a text with control characters or no UTF-8", "",
                             "give plain text")};
}

}  // namespace

expected<ParameterTable, SetupError> ParameterTable::create(std::vector<ParameterSpec> specs,
                                                            std::uint64_t first_revision) {
  if (specs.size() > driver::kParameterCountMax) {
    return setup_error("the device has " + std::to_string(specs.size()) + " parameters",
                       "at most " + std::to_string(driver::kParameterCountMax) + " are possible");
  }
  std::set<std::string_view> names;
  for (const ParameterSpec& spec : specs) {
    const std::string parameter = "the device's parameter \"" + spec.name + "\"";
    if (auto fault = fault_of(spec); !fault.empty()) return setup_error(parameter, fault);
    if (!is_plain(spec.default_value)) {
      return setup_error(parameter, "its default has control characters or is no UTF-8");
    }
    if (!names.insert(spec.name).second) return setup_error(parameter, "there are two of it");
  }
  return ParameterTable(std::move(specs), first_revision);
}

ParameterTable::ParameterTable(std::vector<ParameterSpec> specs, std::uint64_t first_revision)
    : specs_(std::move(specs)), revision_(first_revision) {
  for (const ParameterSpec& spec : specs_) {
    values_.push_back(spec.default_value);
  }
}

std::size_t ParameterTable::index_of(std::string_view name) const noexcept {
  const auto found = std::ranges::find(specs_, name, &ParameterSpec::name);
  return static_cast<std::size_t>(found - specs_.begin());
}

ConfigurationError ParameterTable::unknown(const std::string& name) const {
  return error_of(ConfigurationOutcome::kUnknownParameter, name,
                  "the device has no parameter " + printable(name),
                  specs_.empty() ? "it has none at all" : "", "list its parameters");
}

expected<std::vector<ParameterSetting>, ConfigurationError> ParameterTable::settings(
    std::span<const std::string> names) const {
  std::vector<ParameterSetting> settings;
  for (const std::string& name : names) {
    const std::size_t index = index_of(name);
    if (index == specs_.size()) return unexpected{unknown(name)};
    settings.push_back({name, values_[index]});
  }
  if (!names.empty()) return settings;
  for (std::size_t i = 0; i < specs_.size(); ++i) {
    settings.push_back({specs_[i].name, values_[i]});
  }
  return settings;
}

std::vector<ParameterSetting> ParameterTable::changed_settings() const {
  std::vector<ParameterSetting> settings;
  for (std::size_t i = 0; i < specs_.size(); ++i) {
    if (values_[i] != specs_[i].default_value) settings.push_back({specs_[i].name, values_[i]});
  }
  return settings;
}

expected<std::vector<ParameterSetting>, ConfigurationError> ParameterTable::reset(
    std::span<const std::string> names) const {
  for (const std::string& name : names) {
    if (index_of(name) == specs_.size()) return unexpected{unknown(name)};
  }
  std::vector<ParameterSetting> settings;
  for (std::size_t i = 0; i < specs_.size(); ++i) {
    const ParameterSpec& spec = specs_[i];
    const bool is_meant = names.empty() ? spec.mutability != Mutability::kReadOnly
                                        : std::ranges::find(names, spec.name) != names.end();
    if (is_meant && values_[i] != spec.default_value) {
      settings.push_back({spec.name, spec.default_value});
    }
  }
  return settings;
}

expected<void, ConfigurationError> ParameterTable::check_revision(std::uint64_t revision) const {
  if (revision == revision_) return {};
  return unexpected{error_of(ConfigurationOutcome::kStaleRevision, {}, "nothing was changed",
                             "another client has changed parameters since this one read them",
                             "read them again, and repeat the change if it is still right")};
}

expected<void, ConfigurationError> ParameterTable::check(std::span<const ParameterSetting> settings,
                                                         bool is_active) const {
  std::set<std::string_view> names;
  for (const ParameterSetting& setting : settings) {
    const std::size_t index = index_of(setting.name);
    if (index == specs_.size()) return unexpected{unknown(setting.name)};
    const ParameterSpec& spec = specs_[index];
    if (!names.insert(spec.name).second) {
      return unexpected{error_of(ConfigurationOutcome::kRepeatedParameter, spec.name,
                                 spec.name + " is given twice", "", "give it once")};
    }
    if (spec.mutability == Mutability::kReadOnly) {
      return unexpected{error_of(ConfigurationOutcome::kReadOnly, spec.name,
                                 spec.name + " can't be changed", "it is read-only",
                                 "leave it out")};
    }
    if (auto checked = check_value(spec, setting.value); !checked) return checked;
    if (is_active && spec.mutability == Mutability::kInactive) {
      return unexpected{error_of(ConfigurationOutcome::kWrongState, spec.name,
                                 spec.name + " can't change now", "the device is active",
                                 "deactivate the device first")};
    }
  }
  return {};
}

bool ParameterTable::needs_inactive(std::span<const ParameterSetting> settings) const {
  return std::ranges::any_of(settings, [&](const ParameterSetting& setting) {
    const std::size_t index = index_of(setting.name);
    return index < specs_.size() && specs_[index].mutability == Mutability::kInactive;
  });
}

std::vector<std::string> ParameterTable::commit(std::span<const ParameterSetting> applied) {
  std::vector<std::string> changed;
  for (const ParameterSetting& setting : applied) {
    const std::size_t index = index_of(setting.name);
    if (index == specs_.size() || values_[index] == setting.value) continue;
    values_[index] = setting.value;
    changed.push_back(setting.name);
  }
  if (!changed.empty()) ++revision_;
  return changed;
}

}  // namespace rtpm::gvd
