#pragma once

#include <algorithm>
#include <span>
#include <string_view>
#include <variant>

#include "rtpm/driver/parameter.hpp"

namespace rtpm::device_sim {

/// The value of the parameter `name`, which must have this type; null if it is not in `settings`.
template <class Value>
[[nodiscard]] const Value* find(std::span<const driver::ParameterSetting> settings,
                                std::string_view name) {
  const auto found = std::ranges::find(settings, name, &driver::ParameterSetting::name);
  return found == settings.end() ? nullptr : &std::get<Value>(found->value);
}

/// Assigns the parameter's value to `to` if it is in `settings`.
template <class Value>
void take(std::span<const driver::ParameterSetting> settings, std::string_view name, Value& to) {
  if (const Value* const value = find<Value>(settings, name)) to = *value;
}

}  // namespace rtpm::device_sim
