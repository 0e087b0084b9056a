#include "parameters/parameter_values.hpp"

#include <cstdint>
#include <utility>
#include <variant>

namespace rtpm::console {
namespace {

using driver::ParameterType;
using driver::ParameterValue;

unexpected<std::string> wrong(const gvd::Parameter& parameter, const std::string& needed) {
  return {parameter.spec.name + " takes " + needed};
}

}  // namespace

std::vector<foxglove::ParameterInfo> infos_of(
    const std::string& object, const std::vector<driver::ParameterSetting>& settings) {
  std::vector<foxglove::ParameterInfo> infos;
  for (const driver::ParameterSetting& setting : settings) {
    foxglove::ParameterInfo info{.name = object + "." + setting.name};
    info.value = std::visit([](const auto& one) { return nlohmann::json(one); }, setting.value);
    // JSON has only one kind of number, so the type tells clients that 3.0 is not an integer.
    if (std::holds_alternative<double>(setting.value)) info.type = "float64";
    if (std::holds_alternative<std::vector<double>>(setting.value)) info.type = "float64_array";
    infos.push_back(std::move(info));
  }
  return infos;
}

expected<ParameterValue, std::string> value_of(const gvd::Parameter& parameter,
                                               const nlohmann::json& value) {
  if (value.is_null()) {
    return wrong(parameter, "a value; a device's parameter can't be unset, only reset");
  }
  switch (parameter.spec.type) {
    case ParameterType::kBool:
      if (!value.is_boolean()) return wrong(parameter, "true or false");
      return ParameterValue(value.get<bool>());
    case ParameterType::kInteger: {
      if (value.is_number_integer()) return ParameterValue(value.get<std::int64_t>());
      const double real = value.is_number() ? value.get<double>() : 0.5;
      const bool is_whole = real > -9.0e15 && real < 9.0e15 &&
                            static_cast<double>(static_cast<std::int64_t>(real)) == real;
      if (!is_whole) return wrong(parameter, "a whole number");
      return ParameterValue(static_cast<std::int64_t>(real));
    }
    case ParameterType::kReal:
      if (!value.is_number()) return wrong(parameter, "a number");
      return ParameterValue(value.get<double>());
    case ParameterType::kText:
    case ParameterType::kChoice:
      if (!value.is_string()) return wrong(parameter, "a text");
      return ParameterValue(value.get<std::string>());
    case ParameterType::kVector:
      break;
  }
  if (!value.is_array()) return wrong(parameter, "an array of numbers");
  std::vector<double> elements;
  for (const nlohmann::json& element : value) {
    if (!element.is_number()) return wrong(parameter, "an array of numbers");
    elements.push_back(element.get<double>());
  }
  return ParameterValue(std::move(elements));
}

ParameterName split_name(const std::string& name, const std::vector<std::string>& objects) {
  // Names may contain dots, so the longest matching object counts.
  ParameterName split;
  for (const std::string& object : objects) {
    const bool fits =
        name.size() > object.size() + 1 && name.starts_with(object) && name[object.size()] == '.';
    if (fits && object.size() >= split.object.size()) {
      split = {object, name.substr(object.size() + 1)};
    }
  }
  return split;
}

}  // namespace rtpm::console
