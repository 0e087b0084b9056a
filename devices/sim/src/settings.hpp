#pragma once

#include <algorithm>
#include <span>
#include <string_view>
#include <variant>

#include "rtpm/driver/parameter.hpp"

namespace rtpm::device_sim {

/// The value of the parameter `name`, which has its type; null if it is not one of `settings`.
template <class Value>
[[nodiscard]] const Value* find(std::span<const driver::ParameterSetting> settings,
                                std::string_view name) {
  const auto found = std::ranges::find(settings, name, &driver::ParameterSetting::name);
  return found == settings.end() ? nullptr : &std::get<Value>(found->value);
}

/// Assigns that value to `to`, if there is one.
template <class Value>
void take(std::span<const driver::ParameterSetting> settings, std::string_view name, Value& to) {
  if (const Value* const value = find<Value>(settings, name)) to = *value;
}

}  // namespace rtpm::device_sim
